// Keeps the network out of a controller's callback: a worker thread talks to the server, the callback takes candidates
// and posts what came of them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace palpate {

using Vector = std::array<double, 3>;      // metres, or a direction, in the session's frame
using Quaternion = std::array<double, 4>;  // x, y, z, w

struct Pose {
  Vector position{};
  Quaternion orientation{0, 0, 0, 1};
};

// Where to touch next. It has a fixed size, so that copying it allocates nothing.
struct Candidate {
  static constexpr std::size_t kLongestId = 95;
  std::array<char, kLongestId + 1> id{};  // ends with a zero
  Vector probe_start{};                   // the pad's centre begins here, m
  Vector probe_end{};                     // and gives up here, m
  Vector normal{};                        // outward, of the expected surface
  Pose tool_pose{};                       // of the tool at probe_start
  double failure_risk = 0;                // in [0, 1]
};

// What came of an approach.
struct Outcome {
  enum class Kind : std::uint8_t { kContact, kNoContact, kInvalidContact, kRejected };
  Kind kind = Kind::kNoContact;
  std::array<char, Candidate::kLongestId + 1> candidate_id{};  // Candidate::id
  Pose sensor_pose{};   // contact and invalid contact: of the pad's face, z out of the pad
  Vector force{};       // contact: on the tared sensor, in its own frame, N; pressing gives z < 0
  Vector torque{};      // contact: about the centre of the pad's face, N m
  Vector swept_from{};  // contact and no contact: where the approach began, m
  Vector swept_to{};    // no contact: where it gave up, m
  double sweep_radius_m = 0;
};

enum class State : std::uint8_t {
  kWorking,    // the worker is asking, or trying again; no candidate yet
  kReady,      // a candidate is there, or was taken and its outcome is awaited
  kFinished,   // the server advises to stop, or has no candidate left
  kFailed,     // the server refused something: see error()
};

// Who calls, and whom they trust. All that is empty is left out; the last three are the content of PEM files.
struct Access {
  std::string token;        // as `palpate token create` prints it; anybody on the way reads it unless it is https://
  std::string authority;    // of the server's certificate; without one those count that gRPC brings along
  std::string certificate;  // says who calls in place of a token, with its private key
  std::string key;
};

// A session's robot. try_get_candidate, post_contact and state neither wait, lock nor allocate: call them from one
// thread, at any rate. Everything else is for set-up and the end.
class Explorer {
 public:
  // Connects to `address`, such as 127.0.0.1:7257, or https://lab:7257 where the server speaks TLS, and makes a session.
  // Throws std::runtime_error with the server's words.
  explicit Explorer(const std::string& address, const Access& access = {});
  // Ends the worker; a call under way is cancelled, and an outcome that was not yet sent is lost.
  ~Explorer();
  Explorer(const Explorer&) = delete;
  Explorer& operator=(const Explorer&) = delete;

  // Shows points of the object, seen from `viewpoint`, and starts the worker; once. Throws std::runtime_error.
  void start(const std::vector<Vector>& points, const Vector& viewpoint);

  // The next candidate, once; none while the worker waits for the server.
  std::optional<Candidate> try_get_candidate() noexcept;
  // Hands over what came of the candidate. False while an earlier outcome is still to be taken: try again next time.
  bool post_contact(const Outcome& outcome) noexcept;
  State state() const noexcept;

  // Why the state is kFailed; empty otherwise.
  std::string error() const;
  const std::string& session_id() const noexcept;

 private:
  struct Network;
  void work();

  // Each slot is written by one side only while it is empty and read by the other only while it is full.
  Candidate candidate_{};
  std::atomic<bool> has_candidate_{false};
  Outcome outcome_{};
  std::atomic<bool> has_outcome_{false};
  std::atomic<State> state_{State::kWorking};
  std::atomic<bool> ending_{false};
  static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<State>::is_always_lock_free);
  std::unique_ptr<Network> network_;
  std::thread worker_;
};

}  // namespace palpate
