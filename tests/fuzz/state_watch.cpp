#include "state_watch.h"

#include "motion/attacher.h"
#include "violation.h"

namespace setae {
namespace fuzz {

using protocol::MessageType;

namespace {

bool equal(const protocol::SetLimits& left, const protocol::SetLimits& right) {
  if (memcmp(&left, &right, sizeof(left)) == 0)
    return true;
  uint8_t a[protocol::SetLimits::kSize];
  uint8_t b[protocol::SetLimits::kSize];
  encode(left, a);
  encode(right, b);
  return memcmp(a, b, sizeof(a)) == 0;
}

bool sane(const protocol::SetLimits& limits) {
  for (int i = 0; i < protocol::kServos; ++i) {
    if (limits.pulse_min_ticks[i] < protocol::kPulseTicksAbsoluteMin ||
        limits.pulse_max_ticks[i] > protocol::kPulseTicksAbsoluteMax ||
        limits.pulse_min_ticks[i] > limits.pulse_max_ticks[i]) {
      return false;
    }
  }
  return limits.slew_ticks != 0;
}

}  // namespace

void StateWatch::on_step(const Step& step) {
  check_link(step);
  check_queue(step);
  check_limits(step);
  check_modes(step);
  check_untouched(step);
}

// Each command once, in order, in the session that is open.
void StateWatch::check_link(const Step& step) {
  if (step.after.session != step.before.session) {
    expect(step.is(MessageType::kHello), "only hello opens a session");
    const auto hello = step.read<protocol::Hello>();
    expect(hello.protocol_version == protocol::kProtocolVersion &&
               hello.schema_hash == protocol::kSchemaHash && hello.new_session != 0 &&
               hello.new_session == step.after.session,
           "only a host of the same version opens a session");
    expect(step.after.expected == 0, "a session's numbers begin at 0");
    expect(step.after.epoch != step.before.epoch, "a new session raises the epoch");
    expect(step.after.queued == 0, "a new session drops the queue");
    return;
  }
  const uint8_t taken = static_cast<uint8_t>(step.after.expected - step.before.expected);
  expect(taken == 0 || (taken == 1 && step.next()), "a command is taken once, and in its turn");
}

// Segments come from messages and go by being played, one a frame at most, or all at once with
// their epoch.
void StateWatch::check_queue(const Step& step) {
  int queued = step.before.queued;
  const bool segments = step.is_next(MessageType::kSegments);
  const auto message = segments ? step.read<protocol::Segments>() : protocol::Segments();
  const bool current = segments && message.epoch == step.before.epoch;
  const int now = step.after.queued;
  expect(now <= protocol::kSegmentQueueSlots, "the queue holds no more than its slots");
  if (step.before.epoch != step.after.epoch) {
    expect(now == 0, "a new epoch drops the queue");
    return;
  }
  if (now == 0 && (step.is_next(MessageType::kRelax) || step.is_next(MessageType::kLimp)))
    return;
  if (current && step.taken()) {
    queued += message.count;
    expect(message.count > 0 && message.count <= protocol::kSegmentsPerMessage,
           "a message holds segments");
  }
  const bool played = step.frame_began && step.before.mode == Mode::kPlaying && now == queued - 1;
  expect(now == queued || played, "each segment that was taken is played once");
}

void StateWatch::check_limits(const Step& step) {
  expect(sane(step.after.limits), "the limits in force are possible ones");
  if (equal(step.before.limits, step.after.limits))
    return;
  expect(step.is_next(MessageType::kSetLimits) && step.taken() &&
             equal(step.read<protocol::SetLimits>(), step.after.limits),
         "only set_limits changes the limits");
  expect(step.before.mode == Mode::kRelaxed && step.after.attached == 0,
         "limits change only while relaxed");
}

// What leads into and out of the modes that freeze the robot.
void StateWatch::check_modes(const Step& step) {
  const Mode before = step.before.mode;
  const Mode after = step.after.mode;
  if (after == Mode::kStopped && before != Mode::kStopped)
    expect(step.is(MessageType::kStop) || (step.switch_open && step.before.limits.stop_switch),
           "only a stop, or the switch, leads to stopped");
  if (is_tripped(after) || after == Mode::kStopped || after == Mode::kFault) {
    expect(step.after.guard == protocol::Guard::kOff, "a robot that is frozen is not guarded");
    expect(step.after.queued == 0, "a robot that is frozen has nothing queued");
  }
  if (after == Mode::kAttaching && before != Mode::kAttaching) {
    expect(step.taken() &&
               (step.type() == MessageType::kEnable || step.type() == MessageType::kResume),
           "only enable and resume attach servos");
  }
  if (after == Mode::kPlaying)
    expect(before == Mode::kHolding || before == Mode::kPlaying, "segments play out of a hold");
  if (after == Mode::kRelaxed)
    expect(step.after.attached == 0, "a relaxed robot has no pulses");
  if (after == Mode::kHolding || after == Mode::kPlaying || after == Mode::kUnwinding)
    expect(step.after.attached == kAllServos, "a robot that holds or moves has all its pulses");

  if (!is_latched(before) || after == before)
    return;
  if (after == Mode::kFault)
    return;
  if (after == Mode::kStopped) {
    expect(before != Mode::kFault, "a stop does not end a fault");
    return;
  }
  if (before == Mode::kReflex && after == Mode::kTripped)
    return;
  expect(step.taken() && step.type() == MessageType::kResume,
         "stopped, tripped and fault are left by resume alone");
  expect(step.read<protocol::Resume>().epoch == step.before.epoch,
         "a resume answers what the host has seen");
  expect(before != Mode::kReflex, "no resume ends a reflex");
  expect(after == (step.after.attached == 0            ? Mode::kRelaxed
                   : step.after.attached == kAllServos ? Mode::kHolding
                                                       : Mode::kAttaching),
         "a resume goes where the pulses are");
}

// What is no command in its turn changes nothing.
void StateWatch::check_untouched(const Step& step) {
  if (!step.quiet() || (step.switch_open && step.before.limits.stop_switch))
    return;
  const bool stop_or_hello = step.is(MessageType::kStop) || step.is(MessageType::kHello);
  const bool stale = (step.is_next(MessageType::kSegments) &&
                      step.read<protocol::Segments>().epoch != step.before.epoch) ||
                     (step.is_next(MessageType::kGuard) &&
                      step.read<protocol::GuardMessage>().epoch != step.before.epoch);
  if (stop_or_hello || (step.next() && !stale))
    return;
  expect(step.after.mode == step.before.mode, "only a command in its turn changes the mode");
  expect(step.after.epoch == step.before.epoch, "only a command in its turn changes the epoch");
  expect(step.after.queued == step.before.queued, "only a command in its turn changes the queue");
  expect(step.after.guard == step.before.guard, "only a command in its turn changes the guard");
  expect(step.after.attached == step.before.attached,
         "only a command in its turn changes the pulses");
}

}  // namespace fuzz
}  // namespace setae
