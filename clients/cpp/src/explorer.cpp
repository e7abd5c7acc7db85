#include "palpate/explorer.hpp"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <iterator>
#include <mutex>
#include <random>
#include <stdexcept>

#include "palpate/v1/exploration_service.grpc.pb.h"
#include "palpate/v1/session_service.grpc.pb.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
constexpr auto kDeadline = 60s;
constexpr auto kLongestPause = 5s;
constexpr auto kLookForOutcomes = 1ms;

Vector from(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

void to(const Vector& from, v1::Vector3* to) {
  to->set_x(from[0]);
  to->set_y(from[1]);
  to->set_z(from[2]);
}

void to(const Pose& from, v1::Pose* pose) {
  to(from.position, pose->mutable_position());
  auto* q = pose->mutable_orientation();
  q->set_x(from.orientation[0]);
  q->set_y(from.orientation[1]);
  q->set_z(from.orientation[2]);
  q->set_w(from.orientation[3]);
}

Candidate from(const v1::Candidate& message) {
  Candidate candidate;
  if (message.candidate_id().size() > Candidate::kLongestId) throw std::runtime_error("the candidate's id is too long");
  std::memcpy(candidate.id.data(), message.candidate_id().data(), message.candidate_id().size());
  candidate.probe_start = from(message.probe_start());
  candidate.probe_end = from(message.probe_end());
  candidate.normal = from(message.normal());
  const auto& q = message.tool_pose().orientation();
  candidate.tool_pose = {from(message.tool_pose().position()), {q.x(), q.y(), q.z(), q.w()}};
  candidate.failure_risk = message.failure_risk();
  return candidate;
}

v1::ContactResult message(const Outcome& outcome) {
  v1::ContactResult result;
  result.set_candidate_id(outcome.candidate_id.data());
  switch (outcome.kind) {
    case Outcome::Kind::kContact: {
      auto* contact = result.mutable_contact();
      to(outcome.sensor_pose, contact->mutable_sensor_pose());
      to(outcome.force, contact->mutable_wrench()->mutable_force());
      to(outcome.torque, contact->mutable_wrench()->mutable_torque());
      to(outcome.swept_from, contact->mutable_swept_from());
      break;
    }
    case Outcome::Kind::kNoContact:
      to(outcome.swept_from, result.mutable_no_contact()->mutable_swept_from());
      to(outcome.swept_to, result.mutable_no_contact()->mutable_swept_to());
      result.mutable_no_contact()->set_sweep_radius_m(outcome.sweep_radius_m);
      break;
    case Outcome::Kind::kInvalidContact:
      to(outcome.sensor_pose, result.mutable_invalid_contact()->mutable_sensor_pose());
      break;
    case Outcome::Kind::kRejected:
      result.mutable_rejected();
      break;
  }
  return result;
}

// Unique per logical call, and the same on each retry, so that nothing counts twice.
std::string request_id() {
  static std::random_device random;
  std::string id = "cpp-";
  for (int i = 0; i < 4; ++i) id += std::to_string(random()) + (i < 3 ? "-" : "");
  return id;
}

bool worth_retrying(grpc::StatusCode code) {
  return code == grpc::StatusCode::UNAVAILABLE || code == grpc::StatusCode::DEADLINE_EXCEEDED ||
         code == grpc::StatusCode::RESOURCE_EXHAUSTED;
}

// A token without what a file has around it. gRPC ends the process at a header that it cannot send.
std::string word(const std::string& text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; };
  const auto first = std::find_if_not(text.begin(), text.end(), is_space);
  const auto last = std::find_if_not(text.rbegin(), std::make_reverse_iterator(first), is_space).base();
  if (!std::all_of(first, last, [](char c) { return c > ' ' && c <= '~'; })) {
    throw std::runtime_error("the token is none: it is one word, as `palpate token create` prints it");
  }
  return {first, last};
}

}  // namespace

struct Explorer::Network {
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::SessionService::Stub> sessions;
  std::unique_ptr<v1::ExplorationService::Stub> exploration;
  std::string session_id;
  std::string authorization;              // sent along with each call; empty where there is no token
  std::mutex mutex;                       // guards the two below; the callback never takes it
  std::string error;
  grpc::ClientContext* current = nullptr;  // the call under way, to be cancelled at the end

  // Calls until there is an answer, or `ending`. `patient` calls wait for a server that is away.
  template <typename Call>
  grpc::Status call(const std::atomic<bool>& ending, bool patient, Call&& attempt) {
    for (auto pause = std::chrono::milliseconds(50);; pause = std::min<std::chrono::milliseconds>(2 * pause, kLongestPause)) {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + kDeadline);
      if (!authorization.empty()) context.AddMetadata("authorization", authorization);
      // A proxy before several servers sends the call to the one that has the session in memory.
      if (!session_id.empty()) context.AddMetadata("x-session-id", session_id);
      {
        std::lock_guard lock(mutex);
        if (ending) return {grpc::StatusCode::CANCELLED, "the explorer ends"};
        current = &context;
      }
      const grpc::Status status = attempt(&context);
      {
        std::lock_guard lock(mutex);
        current = nullptr;
      }
      if (status.ok() || !patient || !worth_retrying(status.error_code())) return status;
      for (auto waited = 0ms; waited < pause && !ending; waited += 10ms) std::this_thread::sleep_for(10ms);
    }
  }
};

Explorer::Explorer(const std::string& address, const Access& access) : network_(std::make_unique<Network>()) {
  const auto scheme = address.find("://");
  const auto target = scheme == std::string::npos ? address : address.substr(scheme + 3);
  if (address.compare(0, 8, "https://") == 0) {
    const grpc::SslCredentialsOptions options{access.authority, access.key, access.certificate};
    network_->channel = grpc::CreateChannel(target, grpc::SslCredentials(options));
  } else if (access.authority.empty() && access.certificate.empty()) {
    network_->channel = grpc::CreateChannel(target, grpc::InsecureChannelCredentials());
  } else {
    throw std::runtime_error("certificates are for https://, and " + address + " is not");
  }
  if (const auto token = word(access.token); !token.empty()) network_->authorization = "Bearer " + token;
  network_->sessions = v1::SessionService::NewStub(network_->channel);
  network_->exploration = v1::ExplorationService::NewStub(network_->channel);
  v1::CreateSessionRequest request;
  request.set_request_id(request_id());
  v1::Session session;
  const auto status = network_->call(ending_, false, [&](grpc::ClientContext* context) {
    return network_->sessions->CreateSession(context, request, &session);
  });
  if (!status.ok()) throw std::runtime_error("no session at " + address + ": " + status.error_message());
  network_->session_id = session.session_id();
}

Explorer::~Explorer() {
  {
    std::lock_guard lock(network_->mutex);
    ending_ = true;
    if (network_->current) network_->current->TryCancel();
  }
  if (worker_.joinable()) worker_.join();
}

void Explorer::start(const std::vector<Vector>& points, const Vector& viewpoint) {
  if (worker_.joinable()) throw std::logic_error("start is called once");
  v1::AddVisualPriorRequest request;
  request.set_session_id(network_->session_id);
  request.set_request_id(request_id());
  auto* prior = request.mutable_prior();
  prior->set_encoding(v1::POINT_ENCODING_XYZ_F32_LE);
  to(viewpoint, prior->mutable_viewpoint());
  for (const auto& point : points) {
    for (const double coordinate : point) {
      const auto value = static_cast<float>(coordinate);
      std::array<char, sizeof value> bytes{};
      std::memcpy(bytes.data(), &value, sizeof value);  // little-endian, as every machine that Debian builds gRPC for but s390x
      prior->mutable_points()->append(bytes.data(), bytes.size());
    }
  }
  v1::AddVisualPriorResponse response;
  const auto status = network_->call(ending_, false, [&](grpc::ClientContext* context) {
    return network_->exploration->AddVisualPrior(context, request, &response);
  });
  if (!status.ok()) throw std::runtime_error("the view was refused: " + status.error_message());
  worker_ = std::thread(&Explorer::work, this);
}

std::optional<Candidate> Explorer::try_get_candidate() noexcept {
  if (!has_candidate_.load(std::memory_order_acquire)) return std::nullopt;
  const Candidate candidate = candidate_;
  has_candidate_.store(false, std::memory_order_release);
  return candidate;
}

bool Explorer::post_contact(const Outcome& outcome) noexcept {
  if (has_outcome_.load(std::memory_order_acquire)) return false;
  outcome_ = outcome;
  has_outcome_.store(true, std::memory_order_release);
  return true;
}

State Explorer::state() const noexcept { return state_.load(std::memory_order_acquire); }

std::string Explorer::error() const {
  std::lock_guard lock(network_->mutex);
  return network_->error;
}

const std::string& Explorer::session_id() const noexcept { return network_->session_id; }

void Explorer::work() {
  const auto fail = [&](const std::string& why) {
    std::lock_guard lock(network_->mutex);
    network_->error = why;
    state_.store(State::kFailed, std::memory_order_release);
  };
  // Hands the first candidate to the callback; false where there is none, or the server advises to stop.
  const auto offer = [&](const auto& reply) {
    if (reply.candidates().empty() || reply.should_stop() != v1::STOP_REASON_UNSPECIFIED) {
      state_.store(State::kFinished, std::memory_order_release);
      return false;
    }
    candidate_ = from(reply.candidates(0));
    has_candidate_.store(true, std::memory_order_release);
    state_.store(State::kReady, std::memory_order_release);
    return true;
  };
  try {
    v1::ProposeContactsRequest question;
    question.set_session_id(network_->session_id);
    question.set_top_k(1);
    v1::ProposeContactsResponse first;
    auto status = network_->call(ending_, true, [&](grpc::ClientContext* context) {
      return network_->exploration->ProposeContacts(context, question, &first);
    });
    if (!status.ok()) return fail("no candidate: " + status.error_message());
    if (!offer(first)) return;
    while (!ending_) {
      if (!has_outcome_.load(std::memory_order_acquire)) {
        std::this_thread::sleep_for(kLookForOutcomes);
        continue;
      }
      v1::ReportContactRequest report;
      report.set_session_id(network_->session_id);
      report.set_request_id(request_id());
      report.set_propose(1);
      *report.mutable_result() = message(outcome_);
      state_.store(State::kWorking, std::memory_order_release);
      has_outcome_.store(false, std::memory_order_release);
      v1::ReportContactResponse reply;
      status = network_->call(ending_, true, [&](grpc::ClientContext* context) {
        return network_->exploration->ReportContact(context, report, &reply);
      });
      if (!status.ok()) return fail("the outcome was refused: " + status.error_message());
      if (!offer(reply)) return;
    }
  } catch (const std::exception& failure) {
    fail(failure.what());
  }
}

}  // namespace palpate
