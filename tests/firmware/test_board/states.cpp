// Every cell of the state table, driven through the real board by what a host or a sensor does,
// and seen from the host.
#include <doctest/doctest.h>

#include <string>

#include "../support/rig.h"

using namespace setae;
using protocol::Reflex;
using protocol::Refusal;
using protocol::ResetCause;
using protocol::Sensor;

namespace {

const char* const kModeNames[] = {"relaxed", "attaching", "holding", "playing", "unwinding",
                                  "stopped", "tripped",   "reflex",  "fault"};
const char* const kEventNames[] = {
    "enable",      "segments",    "guard",           "disarm",        "relax",
    "limp",        "set_limits",  "resume_detached", "resume_partly", "resume_attached",
    "stop",        "new_session", "motion_refused",  "attached",      "play",
    "queue_empty", "unwound",     "hold_timeout",    "trip",          "trip_retract",
    "reflex_done", "fault"};

constexpr uint16_t kAway = 2200;
constexpr int32_t kTouch = 1013 * kHpa + 30 * kHpa;
constexpr int32_t kPush = 1013 * kHpa + 90 * kHpa;  // beyond the coarse threshold

protocol::SetLimits limits_with_timeout() {
  protocol::SetLimits limits = kDefaultLimits;
  limits.hold_timeout_s = 1;
  return limits;
}

void stop(Rig& rig) {
  static uint8_t number = 0;
  rig.send(protocol::Stop{++number});
}

// Brings a board into a mode in the ordinary way. `attached` says which of the ways.
void reach(Rig& rig, Mode mode, Event event) {
  const bool detached = event == Event::kResumeDetached;
  const bool partly = event == Event::kResumePartly;
  switch (mode) {
    case Mode::kRelaxed:
      return rig.open();
    case Mode::kAttaching:
      rig.open();
      rig.command(Rig::enable());
      return rig.run_frames(7);
    case Mode::kHolding:
      if (event == Event::kHoldTimeout) {
        rig.open();
        rig.command(limits_with_timeout());
        rig.command(Rig::enable());
        rig.run_frames(25);
        rig.command(rig.segments({Rig::segment(100, kAway)}));
        return rig.run_frames(103);
      }
      if (event == Event::kTrip || event == Event::kFault) {
        rig.hold();
        return rig.arm(Reflex::kHold);
      }
      if (event == Event::kTripRetract) {
        rig.hold_at(kAway);
        return rig.arm(Reflex::kRetract);
      }
      if (event == Event::kSegments) {  // waits for the guard
        rig.hold();
        rig.command(rig.guard());
        return;
      }
      return rig.hold();
    case Mode::kPlaying:
      rig.hold_at(kAway);
      if (event == Event::kTrip || event == Event::kFault)
        rig.arm(Reflex::kHold);
      if (event == Event::kTripRetract)
        rig.arm(Reflex::kRetract);
      rig.command(rig.segments({Rig::segment(100, kAway + 200)}));
      return rig.run_frames(5);
    case Mode::kUnwinding:
      rig.hold_at(kAway);
      rig.command(Rig::relax());
      return rig.run_frames(3);
    case Mode::kStopped:
      if (partly) {
        reach(rig, Mode::kAttaching, event);
      } else {
        rig.hold();
      }
      stop(rig);
      break;
    case Mode::kTripped:
      if (partly) {
        reach(rig, Mode::kAttaching, event);
        rig.pressure_raw = kPush;
        rig.run_frames(3);
      } else {
        rig.hold();
        rig.arm(Reflex::kHold);
        rig.pressure_raw = kTouch;
        rig.run_frames(3);
      }
      rig.acknowledge_all();
      break;
    case Mode::kReflex:
      rig.hold_at(kAway);
      rig.arm(Reflex::kRetract);
      rig.pressure_raw = kTouch;
      rig.run_frames(5);
      rig.acknowledge_all();
      break;
    case Mode::kFault:
      rig.hold();
      rig.arm(Reflex::kHold);
      rig.sensor = Sensor::kAbsent;
      rig.run_frames(2);
      rig.sensor = Sensor::kOk;
      rig.run_frames(3);
      rig.acknowledge_all();
      break;
  }
  if (detached)
    rig.command(protocol::Limp{});
}

// Lets the event happen. False where nothing from outside can bring it about in this mode.
bool drive(Rig& rig, Mode mode, Event event) {
  switch (event) {
    case Event::kEnable:
      rig.command(Rig::enable());
      return true;
    case Event::kSegments:
      rig.command(rig.segments({Rig::segment(100, kFree + 100)}));
      return true;
    case Event::kGuard:
      rig.command(rig.guard());
      return true;
    case Event::kDisarm:
      rig.command(protocol::Disarm{});
      return true;
    case Event::kRelax:
      rig.command(Rig::relax());
      return true;
    case Event::kLimp:
      rig.command(protocol::Limp{});
      return true;
    case Event::kSetLimits:
      rig.command(kDefaultLimits);
      return true;
    case Event::kResumePartly:
      // Only an internal fault can come while the servos attach.
      if (mode == Mode::kFault)
        return false;
      rig.command(rig.resume());
      return true;
    case Event::kResumeDetached:
    case Event::kResumeAttached:
      if (mode == Mode::kAttaching && event == Event::kResumeAttached)
        rig.run_frames(10);
      rig.command(rig.resume());
      return true;
    case Event::kStop:
      stop(rig);
      return true;
    case Event::kNewSession:
      rig.open(static_cast<uint8_t>(rig.session + 1));
      return true;
    case Event::kMotionRefused:
      rig.command(rig.segments({Rig::segment(0, kAway)}));
      return true;
    case Event::kAttached:
      rig.run_frames(20);
      return true;
    case Event::kPlay:
      rig.command(rig.segments({Rig::segment(100, kAway)}));
      return true;
    case Event::kQueueEmpty:
      rig.run_frames(100);
      return true;
    case Event::kUnwound:
      rig.run_frames(60);
      return true;
    case Event::kHoldTimeout:
      rig.run_frames(52);
      return true;
    case Event::kTrip:
      rig.pressure_raw = mode == Mode::kReflex ? kPush + 90 * kHpa : kPush;
      rig.run_frames(3);
      return true;
    case Event::kTripRetract:
      rig.pressure_raw = kTouch;
      rig.run_frames(4);
      return true;
    case Event::kReflexDone:
      rig.run_frames(60);
      return true;
    case Event::kFault:
      if (mode == Mode::kRelaxed) {
        rig.restart(ResetCause::kWatchdog);
        rig.open();
        return true;
      }
      // Elsewhere only the firmware's check of itself finds faults.
      if (mode != Mode::kHolding && mode != Mode::kPlaying)
        return false;
      rig.sensor = Sensor::kBus;
      rig.run_frames(2);
      return true;
  }
  return false;
}

}  // namespace

TEST_CASE("the board does what the state table says, cell by cell") {
  int never = 0;
  int driven = 0;
  std::string left_out;
  for (uint8_t e = 0; e < kEventCount; ++e) {
    for (uint8_t m = 0; m < kModeCount; ++m) {
      const Mode mode = static_cast<Mode>(m);
      const Event event = static_cast<Event>(e);
      const Cell cell = look_up(mode, event);
      CAPTURE(std::string(kModeNames[m]));
      CAPTURE(std::string(kEventNames[e]));
      if (cell.is_never()) {
        ++never;
        continue;
      }
      Rig rig;
      reach(rig, mode, event);
      REQUIRE(rig.board->mode() == mode);
      const size_t refusals = rig.refusals.size();
      if (!drive(rig, mode, event)) {
        left_out += std::string(kModeNames[m]) + "/" + kEventNames[e] + " ";
        continue;
      }
      ++driven;
      if (cell.is_refusal()) {
        CHECK(rig.board->mode() ==
              (mode == Mode::kPlaying && event == Event::kGuard ? Mode::kHolding : mode));
        REQUIRE(rig.refusals.size() == refusals + 1);
        CHECK(rig.last_refusal() == cell.reason());
      } else {
        CHECK(rig.board->mode() == cell.mode());
        CHECK(rig.refusals.size() == refusals + (event == Event::kMotionRefused ? 1 : 0));
      }
      rig.run_frames(1);
      CHECK(rig.state() == state_of(rig.board->mode()));
      CHECK(rig.malformed == 0);
    }
  }
  CHECK(driven > 100);
  CHECK(driven + never + 7 == kEventCount * kModeCount);
  CHECK(left_out ==
        "fault/resume_partly attaching/fault unwinding/fault stopped/fault tripped/fault "
        "reflex/fault fault/fault ");
}

TEST_CASE("a fault leads to fault from every mode, and a stop to stopped but from there") {
  for (uint8_t m = 0; m < kModeCount; ++m) {
    const Mode mode = static_cast<Mode>(m);
    CHECK(look_up(mode, Event::kFault).mode() == Mode::kFault);
    CHECK(look_up(mode, Event::kStop).mode() ==
          (mode == Mode::kFault ? Mode::kFault : Mode::kStopped));
  }
}

TEST_CASE("the latched states are left by a resume, or a stop, and by nothing else") {
  for (Mode mode : {Mode::kStopped, Mode::kTripped, Mode::kFault}) {
    for (uint8_t e = 0; e < kEventCount; ++e) {
      const Event event = static_cast<Event>(e);
      const Cell cell = look_up(mode, event);
      if (!cell.is_mode() || event == Event::kStop || event == Event::kFault)
        continue;
      const bool resume = event == Event::kResumeDetached || event == Event::kResumePartly ||
                          event == Event::kResumeAttached;
      CHECK((cell.mode() == mode) == !resume);
    }
  }
}
