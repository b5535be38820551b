// What the host says: each message is checked, then carried out.
#include "board/board.h"

namespace setae {

using protocol::Guard;
using protocol::MessageType;
using protocol::Refusal;

namespace {

// Each look at what has come costs as much as six bytes. So many are worth one under load.
constexpr uint8_t kBytesAtATime = 32;
// No more between two looks at the sensor, where its sample is urgent.
constexpr uint8_t kBytesBetween = 16;
// Of a new frame some are taken soon, so that a short one is all but done when it ends.
constexpr uint8_t kFirstBytes = 10;
// A stop is to reach the next frame even if it comes just before it.
constexpr uint16_t kAlertUs = 1300;
// Segments that come this soon after the queue ran dry were meant to come before.
constexpr uint8_t kUnderrunFrames = 5;

}  // namespace

void Board::receive() {
  const ReceiveRing& ring = hal_.received();
  const uint8_t waiting = ring.size();
  if (waiting < kBytesAtATime) {
    if (!ring.ended && (receiver_.inside() || waiting < kFirstBytes))
      return;
    // While the line is busy nobody could be answered: let it become more.
    if (hal_.sending() && !hal_.frame_ends_within(kAlertUs))
      return;
  }
  // And not what comes meanwhile, byte by byte, unless it ends a frame.
  if (take_received() && ring.ended)
    take_received();
}

// False where something is more urgent than what is left.
bool Board::take_received() {
  ReceiveRing& ring = hal_.received();
  ring.ended = false;
  uint8_t left = ring.size();
  while (left != 0) {
    uint8_t count = ring.front_size();
    if (count > left)
      count = left;
    if (count > kBytesBetween && sample_is_urgent())
      count = kBytesBetween;
    bool message;
    count = receiver_.take(ring.front(), count, message);
    ring.drop(count);
    left -= count;
    if (message)
      handle_message();
    if (sample_is_urgent()) {
      if (left != 0)
        ring.ended = true;
      return false;
    }
    if (message)
      report();
  }
  return true;
}

void Board::handle_message() {
  const protocol::HostHeader& from = receiver_.header();
  // A stop counts whoever sends it; hello is how a host gets its session.
  if (receiver_.type() == MessageType::kStop)
    return handle_stop();
  if (receiver_.type() == MessageType::kHello)
    return handle_hello();
  if (from.session != session_.id())
    return receiver_.count_stray();
  idle_since_frame_ = frame_;

  switch (receiver_.type()) {
    case MessageType::kPing: {
      protocol::Ping ping;
      decode(receiver_.payload(), ping);
      ping_token_ = ping.token;
      want(kPong);
      return;
    }
    case MessageType::kRecall: {
      protocol::Recall recall;
      decode(receiver_.payload(), recall);
      if (recall.record == static_cast<uint8_t>(protocol::Record::kTrip))
        trip_.recall();
      if (recall.record == static_cast<uint8_t>(protocol::Record::kFault))
        fault_.recall();
      if (recall.record == static_cast<uint8_t>(protocol::Record::kRefusal))
        refusal_.recall();
      return;
    }
    default:
      break;
  }
  if (!session_.open())
    return receiver_.count_stray();

  switch (receiver_.type()) {
    case MessageType::kAcknowledge: {
      protocol::Acknowledge got;
      decode(receiver_.payload(), got);
      const protocol::Record record = static_cast<protocol::Record>(got.record);
      if (record == protocol::Record::kTrip)
        trip_.acknowledge(got.record_id);
      if (record == protocol::Record::kFault)
        fault_.acknowledge(got.record_id);
      if (record == protocol::Record::kRefusal)
        refusal_.acknowledge(got.record_id);
      return;
    }
    case MessageType::kReadLimits:
      want(kLimits);
      return;
    default:
      return handle_reliable();
  }
}

void Board::handle_hello() {
  protocol::Hello hello;
  decode(receiver_.payload(), hello);
  hello_token_ = hello.token;
  want(kHelloReply);
  if (hello.new_session == 0 || hello.new_session == session_.id())
    return;
  // A host of another version learns it from the answer, and moves nothing.
  if (hello.protocol_version != protocol::kProtocolVersion ||
      hello.schema_hash != protocol::kSchemaHash) {
    return;
  }
  session_.start(hello.new_session);
  idle_since_frame_ = frame_;
  stop_known_ = false;
  want(kStatus);
  wanted_ &= static_cast<uint8_t>(~kReceipt);
  gap_ = false;
  if (mode_ == Mode::kPlaying || mode_ == Mode::kUnwinding) {
    freeze();
  } else {
    drop_plans();
  }
  raise(Event::kNewSession);
}

void Board::handle_stop() {
  protocol::Stop stop;
  decode(receiver_.payload(), stop);
  want(kReceipt);
  const uint8_t session = receiver_.header().session;
  if (stop_known_ && stop.stop_number == stop_number_ && session == stop_session_)
    return;
  freeze();
  raise(Event::kStop);
  stop_known_ = true;
  stop_number_ = stop.stop_number;
  stop_session_ = session;
}

void Board::handle_reliable() {
  want(kReceipt);
  switch (session_.judge(receiver_.header().sequence)) {
    case Session::Order::kNext:
      if (carry_out())
        session_.accept();
      return;
    case Session::Order::kOld:
      return;
    case Session::Order::kGap:
      gap_ = true;
      return;
  }
}

// False where the command has to come again.
bool Board::carry_out() {
  Verdict verdict;
  if (decide(verdict))
    return true;
  if (verdict.later || refusal_.pending())
    return false;
  refuse(receiver_.type(), receiver_.header().sequence, verdict);
  return true;
}

void Board::refuse(MessageType type, uint8_t sequence, const Verdict& verdict) {
  protocol::RefusalMessage record = {};
  record.command_type = static_cast<uint8_t>(type);
  record.command_sequence = sequence;
  record.reason = static_cast<uint8_t>(verdict.reason);
  record.index = verdict.index;
  record.value = verdict.value;
  record.limit = verdict.limit;
  refusal_.set(record, session_.id());

  if (type != MessageType::kSegments && type != MessageType::kGuard)
    return;
  if (mode_ == Mode::kPlaying) {
    freeze();
  } else {
    drop_plans();
  }
  raise(Event::kMotionRefused);
}

bool Board::decide(Verdict& verdict) {
  switch (receiver_.type()) {
    case MessageType::kEnable:
      return enable(verdict);
    case MessageType::kResume:
      return resume(verdict);
    case MessageType::kRelax:
      return relax(verdict);
    case MessageType::kLimp:
      limp();
      return true;
    case MessageType::kSegments:
      if (!segments(verdict))
        return false;
      play_if_ready();
      return true;
    case MessageType::kGuard:
      return guard(verdict);
    case MessageType::kDisarm:
      return disarm(verdict);
    case MessageType::kSetLimits:
      return set_limits(verdict);
    case MessageType::kStoreLimits:
      return store_limits(verdict);
    default:
      return verdict.refuse(Refusal::kBadField);
  }
}

bool Board::allows(Event event, Verdict& verdict) const {
  const Refusal reason = ask(event);
  return reason == Refusal::kNone || verdict.refuse(reason);
}

bool Board::enable(Verdict& verdict) {
  protocol::Enable message;
  decode(receiver_.payload(), message);
  if (!allows(Event::kEnable, verdict))
    return false;
  if (record_pending())
    return verdict.refuse(Refusal::kRecordPending);
  if (!limits_.check_pose(message.pulse_ticks, verdict))
    return false;

  for (uint8_t i = 0; i < protocol::kServos; ++i)
    next_.ticks[i] = message.pulse_ticks[i];
  current_ = next_;
  rest_pose_ = next_;
  history_.fill(next_);
  attacher_.start();
  attacher_.step(attached_);
  hal_.set_pulses(next_, attached_);
  detector_.coarse_on(limits_.coarse_threshold_raw());
  raise(Event::kEnable);
  return true;
}

bool Board::resume(Verdict& verdict) {
  protocol::Resume message;
  decode(receiver_.payload(), message);
  if (message.epoch != epoch_)
    return verdict.refuse(Refusal::kWrongEpoch, kNoIndex, message.epoch, epoch_);
  if (record_pending() && mode_ != Mode::kReflex)
    return verdict.refuse(Refusal::kRecordPending);
  if (mode_ == Mode::kFault && fault_persists())
    return verdict.refuse(Refusal::kFault, kNoIndex, fault_.record().fault, 0);
  if (stop_switch_open())
    return verdict.refuse(Refusal::kStopSwitch);
  const Mode before = mode_;
  const Refusal reason = raise(attached_ == 0            ? Event::kResumeDetached
                               : attached_ == kAllServos ? Event::kResumeAttached
                                                         : Event::kResumePartly);
  if (mode_ == Mode::kAttaching && before != Mode::kAttaching)
    attacher_.start();
  return reason == Refusal::kNone || verdict.refuse(reason);
}

bool Board::relax(Verdict& verdict) {
  protocol::Relax message;
  decode(receiver_.payload(), message);
  if (!allows(Event::kRelax, verdict) || !limits_.check_slew(message.slew_ticks, verdict) ||
      !limits_.check_pose(message.free_ticks, verdict)) {
    return false;
  }
  player_.clear();
  detector_.guard_off();
  raise(Event::kRelax);
  if (mode_ == Mode::kUnwinding)
    start_line(message.free_ticks, message.slew_ticks);
  return true;
}

void Board::limp() {
  detector_.guard_off();
  switch_off();
  raise(Event::kLimp);
}

bool Board::segments(Verdict& verdict) {
  protocol::Segments message;
  decode(receiver_.payload(), message);
  if (message.epoch != epoch_)
    return true;  // discarded: it was sent too early
  if (!allows(Event::kSegments, verdict) || !check_segments(message, verdict))
    return false;
  if (message.count > player_.room())
    return verdict.wait();

  if (ran_dry_ && frame_ - ran_dry_frame_ <= kUnderrunFrames)
    ++underruns_;
  ran_dry_ = false;
  for (uint8_t i = 0; i < message.count; ++i)
    player_.push(message.segments[i]);
  raise(Event::kSegments);
  return true;
}

// All of them before any is queued.
bool Board::check_segments(const protocol::Segments& message, Verdict& verdict) const {
  if (message.count == 0 || message.count > protocol::kSegmentsPerMessage) {
    return verdict.refuse(Refusal::kBadField, kNoIndex, message.count,
                          protocol::kSegmentsPerMessage);
  }
  const uint16_t* from = player_.empty() ? next_.ticks : player_.end_ticks();
  for (uint8_t i = 0; i < message.count; ++i) {
    const protocol::Segment& segment = message.segments[i];
    if (segment.duration_frames == 0)
      return verdict.refuse(Refusal::kBadField, i, 0, 1);
    if (!limits_.check_pose(segment.target_ticks, verdict) ||
        !limits_.check_line(from, segment.target_ticks, segment.duration_frames, i, verdict)) {
      return false;
    }
    from = segment.target_ticks;
  }
  return true;
}

bool Board::guard(Verdict& verdict) {
  protocol::GuardMessage message;
  decode(receiver_.payload(), message);
  if (message.epoch != epoch_)
    return true;
  if (!allows(Event::kGuard, verdict))
    return false;
  if (!player_.empty())
    return verdict.refuse(Refusal::kBusy);
  if (!check_guard(message, verdict))
    return false;
  if (sensor_ != protocol::Sensor::kOk) {
    return verdict.refuse(Refusal::kSensorUnavailable, kNoIndex, static_cast<uint8_t>(sensor_), 0);
  }

  reflex_ = static_cast<protocol::Reflex>(message.reflex);
  for (uint8_t i = 0; i < protocol::kServos; ++i)
    retract_ticks_[i] = message.retract_ticks[i];
  retract_slew_ticks_ = message.retract_slew_ticks;
  guard_sequence_ = receiver_.header().sequence;
  detector_.guard_move(message.threshold_raw, message.consecutive, message.deadline_frames);
  raise(Event::kGuard);
  return true;
}

bool Board::check_guard(const protocol::GuardMessage& message, Verdict& verdict) const {
  if (message.threshold_raw == 0 || message.consecutive == 0 || message.consecutive > 8 ||
      message.deadline_frames == 0 || message.reflex >= protocol::kReflexCount) {
    return verdict.refuse(Refusal::kBadField);
  }
  // A guard that is blinder than unguarded motion is none.
  const uint32_t coarse_raw = limits_.coarse_threshold_raw();
  if (coarse_raw != 0 && message.threshold_raw > coarse_raw) {
    return verdict.refuse(Refusal::kOutOfLimits, kNoIndex,
                          static_cast<int32_t>(message.threshold_raw),
                          static_cast<int32_t>(coarse_raw));
  }
  return message.reflex == static_cast<uint8_t>(protocol::Reflex::kHold) ||
         (limits_.check_slew(message.retract_slew_ticks, verdict) &&
          limits_.check_pose(message.retract_ticks, verdict));
}

bool Board::disarm(Verdict& verdict) {
  if (!allows(Event::kDisarm, verdict))
    return false;
  // Segments that wait for the guard must not run without it.
  if (mode_ == Mode::kHolding && !player_.empty())
    return verdict.refuse(Refusal::kBusy);
  detector_.guard_off();
  raise(Event::kDisarm);
  return true;
}

bool Board::set_limits(Verdict& verdict) {
  protocol::SetLimits message;
  decode(receiver_.payload(), message);
  if (!allows(Event::kSetLimits, verdict) || !limits_.set(message, verdict))
    return false;
  store_.cancel();
  return true;
}

bool Board::store_limits(Verdict& verdict) {
  if (!allows(Event::kSetLimits, verdict))
    return false;
  store_.start();
  return true;
}

}  // namespace setae
