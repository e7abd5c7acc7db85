// A controller at 1 kHz explores a ball: `controller 127.0.0.1:7257`.
//
// `Controller::update` stands for a real-time callback: it moves the probe by a step, and neither waits nor allocates.
// The ball is 40 mm in radius at (0.5, 0, 0.1); the probe is a point, so the force acts at the pad's centre.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "palpate/explorer.hpp"

using palpate::Vector;

namespace {

constexpr Vector kCentre{0.5, 0.0, 0.1};
constexpr double kRadius = 0.04;
constexpr double kStep = 0.0005;  // m a tick

double distance(const Vector& a, const Vector& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

class Controller {
 public:
  explicit Controller(palpate::Explorer& explorer) : explorer_(explorer) {}

  void update() noexcept {
    if (pending_) {
      pending_ = !explorer_.post_contact(outcome_);
    } else if (!moving_) {
      if (const auto next = explorer_.try_get_candidate()) {
        candidate_ = *next;
        travelled_ = 0;
        moving_ = true;
      }
    } else {
      move();
    }
  }

  int touches = 0;
  int misses = 0;

 private:
  void move() noexcept {
    const double length = distance(candidate_.probe_start, candidate_.probe_end);
    travelled_ = std::min(travelled_ + kStep, length);
    Vector at;
    for (int k = 0; k < 3; ++k) {
      at[k] = candidate_.probe_start[k] + travelled_ / length * (candidate_.probe_end[k] - candidate_.probe_start[k]);
    }
    outcome_ = {};
    outcome_.candidate_id = candidate_.id;
    outcome_.swept_from = candidate_.probe_start;
    if (distance(at, kCentre) <= kRadius) {
      outcome_.kind = palpate::Outcome::Kind::kContact;
      outcome_.sensor_pose = {at, candidate_.tool_pose.orientation};
      outcome_.force = {0, 0, -2};
      ++touches;
    } else if (travelled_ == length) {
      outcome_.kind = palpate::Outcome::Kind::kNoContact;
      outcome_.swept_to = candidate_.probe_end;
      ++misses;
    } else {
      return;
    }
    moving_ = false;
    pending_ = true;
  }

  palpate::Explorer& explorer_;
  palpate::Candidate candidate_{};
  palpate::Outcome outcome_{};
  double travelled_ = 0;
  bool moving_ = false;
  bool pending_ = false;
};

std::vector<Vector> seen_from_above() {
  std::vector<Vector> points;
  for (int i = 1; i <= 8; ++i) {
    for (int j = 0; j < 16; ++j) {
      const double polar = 0.1 * i, turn = 0.4 * j;
      points.push_back({kCentre[0] + kRadius * std::sin(polar) * std::cos(turn),
                        kCentre[1] + kRadius * std::sin(polar) * std::sin(turn), kCentre[2] + kRadius * std::cos(polar)});
    }
  }
  return points;
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

// The content of the file that an environment variable names; empty where it names none.
std::string named_file(const char* name) {
  const std::string path = environment(name);
  if (path.empty()) return "";
  std::ifstream file(path);
  if (!file) throw std::runtime_error(std::string(name) + ": " + path + " cannot be read");
  return {std::istreambuf_iterator<char>(file), {}};
}

palpate::Access access() {
  return {environment("PALPATE_TOKEN"), named_file("PALPATE_CA"), named_file("PALPATE_CERTIFICATE"),
          named_file("PALPATE_KEY")};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2 || argv[1][0] == '-') {
    std::fprintf(stderr,
                 "usage: %s HOST:PORT   explores a simulated ball with the Palpate server there\n"
                 "PALPATE_TOKEN is the token to call with; with https://HOST:PORT, PALPATE_CA names the PEM file of the\n"
                 "server's authority, and PALPATE_CERTIFICATE and PALPATE_KEY those of a certificate to call with.\n",
                 argv[0]);
    return 2;
  }
  palpate::Explorer explorer(argv[1], access());
  explorer.start(seen_from_above(), {0.5, 0.0, 0.6});
  Controller controller(explorer);
  using Clock = std::chrono::steady_clock;
  std::chrono::duration<double, std::micro> longest{};
  auto tick = Clock::now();
  while (explorer.state() == palpate::State::kWorking || explorer.state() == palpate::State::kReady) {
    const auto begin = Clock::now();
    controller.update();
    longest = std::max<std::chrono::duration<double, std::micro>>(longest, Clock::now() - begin);
    tick += std::chrono::milliseconds(1);
    std::this_thread::sleep_until(tick);
  }
  if (explorer.state() == palpate::State::kFailed) {
    std::fprintf(stderr, "%s\n", explorer.error().c_str());
    return 1;
  }
  std::printf("%d touches, %d misses; the longest callback took %.0f us\nsession %s\n", controller.touches, controller.misses,
              longest.count(), explorer.session_id().c_str());
  return 0;
} catch (const std::exception& failure) {
  std::fprintf(stderr, "%s\n", failure.what());
  return 1;
}
