#include "board/board.h"

#include "board/default_limits.h"
#include "protocol/flash.h"

namespace setae {

using protocol::Guard;
using protocol::Refusal;

namespace {

// 22 mm/s of tendon.
constexpr uint16_t kTimeoutSlewTicks = 16;

constexpr protocol::SetLimits kInitialLimits SETAE_FLASH = kDefaultLimits;

}  // namespace

Cell look_up(Mode mode, Event event) {
  return Cell::from_byte(protocol::flash_read(
      &state_table::kCells[static_cast<uint8_t>(event)][static_cast<uint8_t>(mode)]));
}

void Board::poll() {
  if (!started_)
    start();
  const uint32_t frame = hal_.frame();
  if (frame != frame_)
    begin_frame(frame);
  watch_stop_switch();
  read_sensor();
  receive();
  // Only at rest: a servo's current may pull the supply down in the middle of a byte.
  if (mode_ == Mode::kRelaxed && store_.step(limits_.in_force()))
    want(kStatus);
  report();
}

// What a sample says must reach the next frame, even one that is ready only 0.5 ms before it, and
// so must a stop: near the frame's end, while a sample is being fetched, bytes are taken by turns
// with a look whether it is there.
bool Board::sample_is_urgent() {
  return hal_.sample_on_its_way() && hal_.frame_ends_within(kQuietUs);
}

// In the frame that the board is in, even where the next one has begun.
BoardTime Board::now() {
  const BoardTime now = hal_.now();
  if (now.frame == frame_)
    return now;
  return {frame_, protocol::kServoFrameUs - 1};
}

void Board::start() {
  started_ = true;
  frame_ = hal_.frame();
  idle_since_frame_ = frame_;
  sampled_frame_ = frame_;
  Retained& retained = hal_.retained();
  trip_.begin(retained.trip);
  fault_.begin(retained.fault);
  refusal_.begin(retained.refusal);
  if (!retained.pose.whole())
    retained.pose = retained.pose_copy;
  if (!retained.pose.whole())
    retained.pose.clear();
  if (retained.pose.value.known)
    current_ = retained.pose.value.pulses;
  next_ = current_;
  history_.fill(current_);
  start_limits();

  switch (hal_.reset_cause()) {
    case protocol::ResetCause::kWatchdog:
      fault(protocol::Fault::kWatchdog, 0);
      break;
    case protocol::ResetCause::kBrownOut:
      fault(protocol::Fault::kSupplyLow, 0);
      break;
    default:
      break;
  }
}

void Board::start_limits() {
  protocol::SetLimits limits;
  // What an older firmware took may be out of this one's bounds.
  Verdict verdict;
  if (store_.load(limits) && limits_.set(limits, verdict))
    return;
  protocol::flash_copy(&kInitialLimits, limits);
  if (!limits_.set(limits, verdict))
    fault(protocol::Fault::kInternal, 0);
}

void Board::begin_frame(uint32_t frame) {
  latch_frame(frame);
  check_consistency();
  watch_supply();
  if (detector_.deadline_passed())
    trip(protocol::TripCause::kDeadline);
  watch_hold_timeout();
  advance_motion();
  put_out(current_);
}

void Board::latch_frame(uint32_t frame) {
  frame_ = frame;
  current_ = next_;
  current_attached_ = attached_;
  history_.add(current_);
  Retained& retained = hal_.retained();
  Pose& pose = retained.pose.value;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    if ((current_attached_ >> i) & 1)
      pose.pulses.ticks[i] = current_.ticks[i];
  }
  if (current_attached_ == kAllServos)
    pose.known = true;
  retained.pose.seal();
  retained.pose_copy = retained.pose;

  trip_.on_frame();
  fault_.on_frame();
  refusal_.on_frame();
  if (session_.open())
    want(kTelemetry);
  if (++status_age_frames_ >= protocol::kStatusFrames)
    want(kStatus);
}

// From the pulses of this frame to those of the next.
void Board::advance_motion() {
  switch (mode_) {
    case Mode::kAttaching:
      if (attacher_.step(attached_)) {
        raise(Event::kAttached);
        end_motion();
      }
      break;
    case Mode::kPlaying:
      if (!player_.step(next_)) {
        ran_dry_ = true;
        ran_dry_frame_ = frame_;
        raise(Event::kQueueEmpty);
        end_motion();
      }
      break;
    case Mode::kUnwinding:
      if (line_.running()) {
        line_.step(next_);
      } else {
        raise(Event::kUnwound);
        switch_off();
      }
      break;
    case Mode::kReflex:
      if (line_.running()) {
        line_.step(next_);
      } else {
        raise(Event::kReflexDone);
        end_motion();
      }
      break;
    default:
      break;
  }
}

void Board::watch_hold_timeout() {
  if (mode_ != Mode::kHolding)
    idle_since_frame_ = frame_;
  const uint32_t timeout_frames = limits_.hold_timeout_frames();
  if (timeout_frames == 0)
    return;
  if (frame_ - idle_since_frame_ < timeout_frames)
    return;
  raise(Event::kHoldTimeout);
  drop_plans();
  const uint16_t fastest = limits_.in_force().slew_ticks;
  start_line(rest_pose_.ticks, kTimeoutSlewTicks < fastest ? kTimeoutSlewTicks : fastest);
}

// From the next frame on.
void Board::put_out(const Pulses& set_before) {
  if (attached_ == kAllServos && current_attached_ == kAllServos) {
    limits_.confine(current_, next_);
  }
  const uint32_t running = hal_.set_pulses(next_, attached_);
  if (running == frame_)
    return;
  // The loop was late: another frame has begun, with what was set before.
  const Pulses planned = next_;
  next_ = set_before;
  latch_frame(running);
  next_ = planned;
}

void Board::check_consistency() {
  const bool moves = mode_ == Mode::kHolding || mode_ == Mode::kPlaying ||
                     mode_ == Mode::kUnwinding || mode_ == Mode::kReflex;
  const bool right =
      (!moves || attached_ == kAllServos) && (mode_ != Mode::kRelaxed || attached_ == 0) &&
      (detector_.guard() == Guard::kOff || mode_ == Mode::kHolding || mode_ == Mode::kPlaying);
  if (!right && mode_ != Mode::kFault) {
    fault(protocol::Fault::kInternal, static_cast<uint32_t>(mode_) << 8 | attached_);
  }
}

Refusal Board::ask(Event event) const {
  const Cell cell = look_up(mode_, event);
  return cell.is_refusal() ? cell.reason() : Refusal::kNone;
}

Refusal Board::raise(Event event) {
  const Cell cell = look_up(mode_, event);
  if (cell.is_refusal())
    return cell.reason();
  if (cell.is_mode()) {
    mode_ = cell.mode();
  } else {
    fault(protocol::Fault::kInternal,
          0x10000UL | static_cast<uint16_t>(mode_) << 8 | static_cast<uint8_t>(event));
  }
  return Refusal::kNone;
}

void Board::play_if_ready() {
  if (player_.empty() || detector_.guard() == Guard::kTaring)
    return;
  const bool begins = mode_ == Mode::kHolding;
  if (begins && detector_.guard() == Guard::kOff)
    detector_.coarse_on(limits_.coarse_threshold_raw());
  raise(Event::kPlay);
  if (!begins)
    return;
  // The first step is not for the next frame's start to make, but for its pulses to show.
  const Pulses held = next_;
  player_.step(next_);
  put_out(held);
}

void Board::freeze() {
  // A frame may have begun since this poll did; its pulses are the ones to stay at.
  const uint32_t frame = hal_.frame();
  if (frame != frame_)
    latch_frame(frame);
  const Pulses planned = next_;
  next_ = current_;
  const uint32_t running = hal_.set_pulses(next_, attached_);
  if (running != frame_) {
    // One has begun just now, with what was planned: then that is where to stay.
    next_ = planned;
    latch_frame(running);
    hal_.set_pulses(next_, attached_);
  }
  end_motion();
  drop_plans();
}

void Board::drop_plans() {
  player_.clear();
  detector_.guard_off();
  ran_dry_ = false;
  ++epoch_;
}

void Board::switch_off() {
  attached_ = 0;
  hal_.set_pulses(next_, attached_);
  player_.clear();
  end_motion();
}

void Board::end_motion() {
  line_.cancel();
  detector_.coarse_off();
}

void Board::start_line(const uint16_t* to_ticks, uint16_t slew_ticks) {
  line_.start_at_slew(next_, to_ticks, slew_ticks);
  detector_.coarse_on(limits_.coarse_threshold_raw());
}

}  // namespace setae
