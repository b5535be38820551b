// What the host gets to know. Each message waits as a flag until the line has room for all of
// it, the urgent ones first; what is on its way can't be overtaken, so little is written ahead.
#include "board/board.h"
#include "board/time.h"
#include "board/version.h"
#include "protocol/crc32c.h"

namespace setae {

namespace {

// What comes while a frame begins and a report is made finds room beside so many.
constexpr uint8_t kReceivedFirstBytes = 48;

}  // namespace

// Nothing overtakes what finds no room: small answers to a host that asks without a break would
// keep the line from ever having room for a record.
// What the board sends by itself goes first, for the same reason: records and telemetry come at
// their own pace, answers as fast as they are asked for.
void Board::report() {
  if (!transmitter_.ready())
    return;
  const bool open = session_.open();
  uint8_t wanted = wanted_;
  // The poll in which a frame begins is the longest already.
  if (!open || (wanted & kTelemetry) != 0)
    wanted &= static_cast<uint8_t>(~kStatus);
  const bool record = trip_.wanted(open) || fault_.wanted(open) || refusal_.wanted(open);
  if (wanted == 0 && !record)
    return;
  // Answers can wait; bytes that find no room are lost.
  if (hal_.received().size() > kReceivedFirstBytes || hal_.frame_ends_within(kQuietUs))
    return;
  if (record && (!send_latched(trip_) || !send_latched(fault_) || !send_latched(refusal_)))
    return;
  while (wanted != 0 && transmitter_.ready() && !hal_.frame_ends_within(kQuietUs)) {
    const uint8_t first = wanted & static_cast<uint8_t>(-wanted);
    send(static_cast<Report>(first));
    wanted &= static_cast<uint8_t>(~first);
    wanted_ &= static_cast<uint8_t>(~first);
  }
}

void Board::send(Report report) {
  switch (report) {
    case kTelemetry:
      return send_telemetry();
    case kReceipt:
      return send_receipt();
    case kHelloReply:
      return send_hello_reply();
    case kPong:
      return send_pong();
    case kLimits:
      return send_limits();
    default:
      return send_status();
  }
}

// Only where the line has room, as those below. False: it hadn't for this one.
template <typename Record>
bool Board::send_latched(Latch<Record>& latch) {
  if (!latch.wanted(session_.open()))
    return true;
  if (!transmitter_.send(Header(*this), latch.record()))
    return false;
  latch.sent();
  return true;
}

Board::Header::Header(const Board& board) {
  session = board.session_.id();
  expected = board.session_.expected();
  credit = board.player_.room();
  epoch = board.epoch_;
  state = static_cast<uint8_t>(state_of(board.mode_));
  if (board.refusal_.pending())
    state |= protocol::kRefusalWaits;
}

void Board::send_receipt() {
  const protocol::Receipt receipt = {gap_};
  transmitter_.send(Header(*this), receipt);
  gap_ = false;
}

void Board::send_hello_reply() {
  protocol::HelloReply reply = {};
  reply.protocol_version = protocol::kProtocolVersion;
  reply.schema_hash = protocol::kSchemaHash;
  reply.token = hello_token_;
  reply.firmware_major = kFirmwareMajor;
  reply.firmware_minor = kFirmwareMinor;
  reply.firmware_patch = kFirmwarePatch;
  reply.previous_session = session_.previous();
  reply.reset_cause = static_cast<uint8_t>(hal_.reset_cause());
  uint8_t limits[protocol::SetLimits::kSize];
  encode(limits_.in_force(), limits);
  reply.limits_crc = protocol::crc32c(limits, sizeof(limits));
  const Pose& pose = hal_.retained().pose.value;
  reply.pose_known = pose.known;
  for (uint8_t i = 0; i < protocol::kServos; ++i)
    reply.pulse_ticks[i] = pose.pulses.ticks[i];
  reply.sensor = static_cast<uint8_t>(sensor_);
  transmitter_.send(Header(*this), reply);
}

void Board::send_limits() {
  transmitter_.send_as(protocol::Limits::kType, Header(*this), limits_.in_force());
}

void Board::send_pong() {
  // The moment of answering, not of asking: the host halves the round trip.
  const BoardTime now = hal_.now();
  const protocol::Pong pong = {ping_token_, now.frame, now.phase_us};
  transmitter_.send(Header(*this), pong);
}

void Board::send_telemetry() {
  const BoardTime time = now();
  protocol::Telemetry telemetry = {};
  telemetry.frame = time.frame;
  telemetry.phase_us = time.phase_us;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    telemetry.pulse_ticks[i] = current_.ticks[i];
  }
  telemetry.attached = current_attached_;
  telemetry.queued = player_.queued();
  telemetry.guard = static_cast<uint8_t>(detector_.guard());
  telemetry.reflex_running = mode_ == Mode::kReflex;
  telemetry.sensor = static_cast<uint8_t>(sensor_);
  telemetry.baseline_raw = detector_.baseline_raw();
  telemetry.sample_count = samples_.size();
  for (uint8_t i = 0; i < samples_.size(); ++i) {
    telemetry.samples[i].pressure_raw = samples_[i].pressure_raw;
    telemetry.samples[i].age_us = age_us(samples_[i].sampled, time);
  }
  telemetry.rx_damaged = receiver_.damaged();
  telemetry.stop_number = stop_number_;
  telemetry.underruns = underruns_;
  transmitter_.send(Header(*this), telemetry);
  samples_.clear();
}

void Board::send_status() {
  const LineErrors errors = hal_.line_errors();
  protocol::Status status = {};
  status.supply_mv = supply_mv(hal_.bandgap_part());
  status.stored_crc = store_.crc();
  status.storing = store_.storing();
  status.stop_switch_open = hal_.stop_switch_open();
  status.rx_framing_errors = errors.framing;
  status.rx_overruns = errors.overrun;
  status.rx_overflows = errors.dropped;
  status.late_pulses = hal_.late_pulses();
  transmitter_.send(Header(*this), status);
  status_age_frames_ = 0;
}

}  // namespace setae
