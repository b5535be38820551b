#include "motion_watch.h"

#include <stdlib.h>

#include "motion/attacher.h"
#include "violation.h"

namespace setae {
namespace fuzz {

using protocol::MessageType;

namespace {

bool moves(Mode mode) {
  return mode == Mode::kPlaying || mode == Mode::kUnwinding || mode == Mode::kReflex;
}

void check_pairs(const Pulses& pulses, const protocol::SetLimits& limits) {
  for (int pair = 0; pair < protocol::kPairs; ++pair) {
    const int a = pulses.ticks[pair];
    const int b = pulses.ticks[pair + protocol::kPairs];
    // A straight line is rounded to one tick for each servo.
    expect(a + b <= limits.pair_sum_max_ticks[pair] + 1 &&
               a + b >= limits.pair_sum_min_ticks[pair] - 1,
           "no two opposite tendons crush the spring");
    expect(a - b <= limits.pair_difference_max_ticks[pair] + 1 &&
               a - b >= limits.pair_difference_min_ticks[pair] - 1,
           "no two opposite tendons bend it too far");
  }
}

}  // namespace

void MotionWatch::on_output(const Output& output, const protocol::SetLimits& limits, bool polling) {
  // Limp and enable between two frames: the host chose another pose to attach at.
  const bool anew = output.attached == 1;
  bool moved = false;
  for (int i = 0; i < protocol::kServos; ++i) {
    if (((output.attached >> i) & 1) == 0)
      continue;
    const int ticks = output.pulses.ticks[i];
    expect(ticks >= protocol::kPulseTicksAbsoluteMin && ticks <= protocol::kPulseTicksAbsoluteMax,
           "each pulse stays within the absolute bounds");
    expect(ticks >= limits.pulse_min_ticks[i] && ticks <= limits.pulse_max_ticks[i],
           "each pulse stays within its limits");
    if (((last_.attached >> i) & 1) == 0 || anew)
      continue;
    const int ticks_moved = abs(ticks - last_.pulses.ticks[i]);
    expect(ticks_moved <= limits.slew_ticks, "no pulse changes faster than the slew limit");
    moved = moved || ticks_moved != 0;
  }
  if (output.attached == kAllServos)
    check_pairs(output.pulses, limits);

  const int attached_now = __builtin_popcount(output.attached);
  const int attached_before = __builtin_popcount(last_.attached);
  expect(attached_now <= attached_before + 1, "servos attach one at a time");
  if (attached_now > attached_before) {
    owes_enable_ = polling && !(enabled_ && attach_mode_);
    if (!owes_enable_)
      check_enabled();
  }
  if (moved) {
    expect(!frozen_, "nothing moves after a stop, a trip or a fault");
    owes_order_ = polling && !(motion_mode_ && is_ordered());
    owes_retract_ = owes_order_ && !toward_retract(output);
    if (!owes_order_)
      check_order(toward_retract(output));
  }
  last_ = output;
  motion_mode_ = moves(mode_);
  attach_mode_ = mode_ == Mode::kAttaching;
  reflex_mode_ = mode_ == Mode::kReflex;
}

void MotionWatch::check_enabled() const {
  expect(enabled_ && attach_mode_, "no servo gets pulses unless enabled");
}

bool MotionWatch::is_ordered() const {
  return segments_ || unwinding_ || reflex_mode_;
}

void MotionWatch::check_order(bool toward_retract) const {
  expect(motion_mode_, "nothing moves in a mode of rest");
  expect(is_ordered(), "nothing moves without an order");
  if (reflex_mode_)
    expect(toward_retract, "the reflex goes where the guard said");
}

bool MotionWatch::toward_retract(const Output& output) const {
  for (int i = 0; i < protocol::kServos; ++i) {
    const int left = abs(output.pulses.ticks[i] - retract_ticks_[i]);
    if (left > abs(last_.pulses.ticks[i] - retract_ticks_[i]))
      return false;
  }
  return true;
}

void MotionWatch::on_step(const Step& step, const Pulses& output) {
  const Mode before = step.before.mode;
  mode_ = step.after.mode;
  motion_mode_ = motion_mode_ || moves(before) || moves(mode_);
  attach_mode_ = attach_mode_ || before == Mode::kAttaching || mode_ == Mode::kAttaching;
  reflex_mode_ = reflex_mode_ || mode_ == Mode::kReflex;
  if (step.delivered)
    allow(step);
  if (step.after.attached == 0)
    enabled_ = false;
  if (step.before.epoch != step.after.epoch)
    segments_ = false;
  if (step.after.session != step.before.session)
    unwinding_ = false;
  const bool tripped = is_tripped(mode_) && !is_tripped(before);
  const bool faulted = mode_ == Mode::kFault && before != Mode::kFault;
  if (tripped || faulted || (mode_ == Mode::kTripped && before == Mode::kReflex))
    freeze();
  if (mode_ == Mode::kReflex) {
    expect(guard_retracts_, "only a guard that asked for it retracts");
    frozen_ = false;
  }

  // A hold that timed out needs no order but time.
  const uint32_t held_frames = step.after.frame - heard_frame_;
  if (mode_ == Mode::kUnwinding && before == Mode::kHolding && !step.is(MessageType::kRelax)) {
    const uint16_t timeout_s = step.before.limits.hold_timeout_s;
    expect(timeout_s != 0 && held_frames >= timeout_s * 50u, "a hold lasts until its time is over");
    unwinding_ = true;
  }
  if (owes_enable_)
    check_enabled();
  if (owes_order_)
    check_order(!owes_retract_);
  owes_enable_ = owes_order_ = false;
  if (before == Mode::kPlaying && mode_ == Mode::kHolding && !step.delivered &&
      step.before.epoch == step.after.epoch) {
    expect(memcmp(output.ticks, end_ticks_, sizeof(end_ticks_)) == 0,
           "playback ends at the end of the last segment");
  }
}

void MotionWatch::allow(const Step& step) {
  if (step.in_session() || step.after.session != step.before.session)
    heard_frame_ = step.after.frame;
  if (step.after.session != step.before.session)
    stop_known_ = false;
  if (step.is(MessageType::kStop)) {
    const uint8_t number = step.read<protocol::Stop>().stop_number;
    if (stop_known_ && number == stop_number_ && step.session() == stop_session_)
      return;  // the same stop again
    stop_known_ = true;
    stop_number_ = number;
    stop_session_ = step.session();
    expect(step.after.mode == Mode::kStopped || step.after.mode == Mode::kFault,
           "a stop always wins");
    expect(step.after.epoch != step.before.epoch, "a stop raises the epoch");
    expect(step.after.queued == 0, "a stop empties the queue");
    freeze();
  }
  if (!step.next())
    return;
  switch (step.type()) {
    case MessageType::kEnable:
      if (step.before.mode == Mode::kRelaxed && step.after.mode == Mode::kAttaching)
        enabled_ = true;
      break;
    case MessageType::kResume:
      if (step.read<protocol::Resume>().epoch == step.before.epoch && !is_latched(step.after.mode))
        frozen_ = false;
      break;
    case MessageType::kRelax:
      unwinding_ = unwinding_ || step.after.mode == Mode::kUnwinding;
      break;
    case MessageType::kLimp:
      expect(step.after.attached == 0, "limp takes the pulses away in every state");
      enabled_ = segments_ = unwinding_ = false;
      break;
    case MessageType::kSegments: {
      const auto message = step.read<protocol::Segments>();
      if (message.epoch != step.before.epoch || step.after.queued <= step.before.queued)
        break;
      segments_ = true;
      memcpy(end_ticks_, message.segments[message.count - 1].target_ticks, sizeof(end_ticks_));
      break;
    }
    case MessageType::kGuard: {
      if (!step.guards())
        break;
      const auto message = step.read<protocol::GuardMessage>();
      guard_retracts_ = message.reflex == static_cast<uint8_t>(protocol::Reflex::kRetract);
      memcpy(retract_ticks_, message.retract_ticks, sizeof(retract_ticks_));
      break;
    }
    default:
      break;
  }
}

void MotionWatch::freeze() {
  frozen_ = true;
  segments_ = unwinding_ = false;
}

}  // namespace fuzz
}  // namespace setae
