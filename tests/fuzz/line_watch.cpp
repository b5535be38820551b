#include "line_watch.h"

#include "violation.h"

namespace setae {
namespace fuzz {

using protocol::MessageType;

Reached reached = {};

namespace {

// Frames until the next copy, and the one in which it was latched.
constexpr uint32_t kRepeatFrames = protocol::kRecordRepeatFrames + 1;

template <typename Message>
Message read(const Inside& inside) {
  Message message;
  decode(inside.bytes + protocol::BoardHeader::kSize, message);
  return message;
}

}  // namespace

void LineWatch::on_restart(bool powered_off) {
  LineWatch anew;
  if (!powered_off)
    memcpy(anew.records_, records_, sizeof(records_));
  *this = anew;
  for (Record& known : records_)
    known.due_tick = kRepeatFrames;
}

void LineWatch::on_bytes(const uint8_t* wire, size_t size) {
  for (size_t taken = 0; taken < size;) {
    ReferenceDecoder::Found found;
    taken += decoder_.take(wire + taken, size - taken, found);
    expect(found != ReferenceDecoder::Found::kDamage, "the board sends whole frames");
    if (found == ReferenceDecoder::Found::kFrame)
      hear(decoder_.inside());
  }
}

void LineWatch::hear(const Inside& inside) {
  const auto type = static_cast<MessageType>(inside.bytes[0]);
  const uint8_t payload = protocol::board_payload_size(type);
  expect(payload != 0xFF && inside.size == protocol::BoardHeader::kSize + payload,
         "the board sends messages of the protocol");
  protocol::BoardHeader header;
  decode(inside.bytes, header);
  expect(!heard_ || header.sequence == static_cast<uint8_t>(last_.sequence + 1),
         "the board numbers its frames");
  expect((header.state & ~protocol::kRefusalWaits) < protocol::kStateCount,
         "the board is in a state of the protocol");
  expect(header.credit <= protocol::kSegmentQueueSlots, "the board grants no room it lacks");
  heard_ = true;
  last_ = header;
  last_is_new_ = true;
  switch (type) {
    case MessageType::kTelemetry: {
      const auto telemetry = read<protocol::Telemetry>(inside);
      expect(telemetry.queued + header.credit == protocol::kSegmentQueueSlots,
             "credit is the slots that are free");
      break;
    }
    case MessageType::kTrip: {
      const auto trip = read<protocol::Trip>(inside);
      note(protocol::Record::kTrip, trip.record_id);
      reached.trip_cause[trip.cause] = true;
      break;
    }
    case MessageType::kFault: {
      const auto fault = read<protocol::FaultMessage>(inside);
      expect(fault.fault != static_cast<uint8_t>(protocol::Fault::kInternal),
             "the board is never at odds with itself");
      note(protocol::Record::kFault, fault.record_id);
      reached.fault[fault.fault] = true;
      break;
    }
    case MessageType::kRefusal: {
      const auto refusal = read<protocol::RefusalMessage>(inside);
      note(protocol::Record::kRefusal, refusal.record_id);
      reached.refusal[refusal.reason] = true;
      break;
    }
    default:
      break;
  }
}

void LineWatch::note(protocol::Record record, uint8_t id) {
  expect(id != 0, "a record's id is never 0");
  Record& known = records_[static_cast<int>(record)];
  if (id != known.id)
    known.pending = true;
  known.id = id;
  known.due_tick = ticks_ + kRepeatFrames;
}

void LineWatch::latched(protocol::Record record) {
  Record& known = records_[static_cast<int>(record)];
  if (!known.pending)
    known.due_tick = ticks_ + 1;
  known.pending = true;
}

void LineWatch::on_step(const Step& step) {
  ticks_ += step.frame_began;
  reached.mode[static_cast<int>(step.after.mode)] = true;
  if (is_tripped(step.after.mode) && !is_tripped(step.before.mode))
    latched(protocol::Record::kTrip);
  if (step.after.mode == Mode::kFault && step.before.mode != Mode::kFault)
    latched(protocol::Record::kFault);
  if (step.is(MessageType::kAcknowledge) && step.in_session()) {
    const auto message = step.read<protocol::Acknowledge>();
    if (message.record < kRecords) {
      Record& known = records_[message.record];
      if (message.record_id == known.id)
        known.pending = false;
    }
  }
  // A command that was taken was carried out, discarded, or refused with a record.
  if (step.is_next(MessageType::kSegments) && step.taken()) {
    const bool queued = step.after.epoch == step.before.epoch;
    const bool discarded = step.read<protocol::Segments>().epoch != step.before.epoch;
    // The switch stopped the robot before the message was read, and so raised the epoch.
    const bool switched =
        step.switch_open && step.after.mode == Mode::kStopped && step.before.mode != Mode::kStopped;
    expect(queued || discarded || switched || step.after.refusal_pending || step.frame_began ||
               step.reading.fresh,
           "segments that are taken and not queued are refused");
  }
  if (step.stalled || step.after.session == 0) {
    for (Record& known : records_)
      known.due_tick = ticks_ + kRepeatFrames;
    return;
  }
  for (Record& known : records_)
    expect(!known.pending || ticks_ <= known.due_tick,
           "a record is repeated until it is acknowledged");
  if (!last_is_new_ || !step.quiet())
    return;
  expect(last_.session == step.after.session, "a frame says its session");
  expect(last_.expected == step.after.expected, "a frame acknowledges what was taken");
  expect(last_.epoch == step.after.epoch, "a frame says its epoch");
  expect(last_.credit == protocol::kSegmentQueueSlots - step.after.queued,
         "credit is the slots that are free");
  expect(
      (last_.state & ~protocol::kRefusalWaits) == static_cast<uint8_t>(state_of(step.after.mode)),
      "a frame says the board's state");
  expect((last_.state & protocol::kRefusalWaits) != 0 == step.after.refusal_pending,
         "a frame says whether a refusal waits");
}

}  // namespace fuzz
}  // namespace setae
