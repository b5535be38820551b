// What a host, or a person beside the robot, would miss if it were otherwise.
#include <doctest/doctest.h>
#include <stdlib.h>

#include <algorithm>

#include "../support/rig.h"
#include "protocol/crc32c.h"

using namespace setae;
using protocol::Fault;
using protocol::Guard;
using protocol::Record;
using protocol::Reflex;
using protocol::Refusal;
using protocol::ResetCause;
using protocol::Sensor;
using protocol::State;
using protocol::TripCause;

namespace {

constexpr int32_t kRest = 1013 * kHpa;
constexpr int32_t kTouch = kRest + 30 * kHpa;
constexpr uint16_t kAway = 2200;

struct HoldingRig : Rig {
  HoldingRig() { hold(); }
};

// No frame after `from` puts out anything but what frame `from` did.
bool frozen_since(const Rig& rig, size_t from) {
  for (size_t i = from + 1; i < rig.outputs.size(); ++i) {
    for (uint8_t servo = 0; servo < 4; ++servo) {
      if (rig.outputs[i].pulses.ticks[servo] != rig.outputs[from].pulses.ticks[servo]) {
        return false;
      }
    }
  }
  return true;
}

// The command is refused with this reason, is answered, and moves nothing.
template <typename Message>
void check_refused(Rig& rig, const Message& message, Refusal reason) {
  const size_t before = rig.refusals.size();
  const size_t frame = rig.outputs.size() - 1;
  const uint8_t sequence = rig.next_sequence;
  CHECK(rig.command(message));
  REQUIRE(rig.refusals.size() == before + 1);
  const protocol::RefusalMessage& refusal = rig.refusals.back().message;
  CHECK(refusal.reason == static_cast<uint8_t>(reason));
  CHECK(refusal.command_type == static_cast<uint8_t>(Message::kType));
  CHECK(refusal.command_sequence == sequence);
  rig.run_frames(10);
  CHECK(frozen_since(rig, frame));
  rig.acknowledge_all();
}

}  // namespace

// ---------------------------------------------------------------- handshake and session

TEST_CASE("before a session the board answers hello and ping, and carries out nothing else") {
  Rig rig;
  rig.send(protocol::Ping{77});
  REQUIRE(rig.pongs.size() == 1);
  CHECK(rig.pongs[0].message.token == 77);
  rig.send(protocol::Hello{1, 2, 0, 0xCAFE});
  REQUIRE(rig.hellos.size() == 1);
  CHECK(rig.hellos[0].message.token == 0xCAFE);
  CHECK(rig.header.session == 0);

  rig.send(Rig::enable());
  rig.send(protocol::ReadLimits{});
  rig.run_frames(10);
  CHECK(rig.receipts.empty());
  CHECK(rig.limits.empty());
  CHECK(rig.telemetries.empty());
  CHECK(rig.hal.attached() == 0);
}

TEST_CASE("hello tells versions, limits, pose and sensor") {
  Rig rig;
  rig.open(7);
  const protocol::HelloReply& reply = rig.hellos.back().message;
  CHECK(rig.header.session == 7);
  CHECK(reply.protocol_version == protocol::kProtocolVersion);
  CHECK(reply.schema_hash == protocol::kSchemaHash);
  CHECK(reply.pose_known == 1);
  CHECK(reply.pulse_ticks[3] == kFree);
  CHECK(reply.sensor == static_cast<uint8_t>(Sensor::kOk));
  CHECK(reply.previous_session == 0);

  rig.send(protocol::ReadLimits{});
  REQUIRE(rig.limits.size() == 1);
  uint8_t payload[protocol::Limits::kSize];
  encode(rig.limits[0].message, payload);
  CHECK(reply.limits_crc == protocol::crc32c(payload, sizeof(payload)));

  rig.open(8);
  CHECK(rig.hellos.back().message.previous_session == 7);
}

TEST_CASE("a host of another version gets an answer and no session") {
  Rig rig;
  rig.send_as(0, protocol::Hello{protocol::kProtocolVersion + 1, protocol::kSchemaHash, 9, 1});
  rig.send_as(0, protocol::Hello{protocol::kProtocolVersion, protocol::kSchemaHash ^ 1, 9, 1});
  CHECK(rig.hellos.size() == 2);
  CHECK(rig.header.session == 0);
}

TEST_CASE("hello with the running session changes nothing") {
  HoldingRig rig;
  rig.command(rig.segments({Rig::segment(50, 1900)}));
  rig.run_frames(5);
  const uint8_t expected = rig.header.expected;
  const uint8_t epoch = rig.header.epoch;
  rig.send_as(0, protocol::Hello{protocol::kProtocolVersion, protocol::kSchemaHash, 7, 5});
  CHECK(rig.header.expected == expected);
  CHECK(rig.header.epoch == epoch);
  rig.run_frames(50);
  CHECK(rig.pulse() == 1900);
}

TEST_CASE("a new session freezes the old one's motion and drops its queue") {
  HoldingRig rig;
  rig.command(rig.segments({Rig::segment(50, 1900)}));
  rig.run_frames(10);
  const size_t frame = rig.outputs.size() - 1;
  const uint8_t epoch = rig.header.epoch;
  rig.open(8);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.header.epoch == static_cast<uint8_t>(epoch + 1));
  CHECK(rig.header.expected == 0);
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
  rig.run_frames(20);
  CHECK(frozen_since(rig, frame));
}

TEST_CASE("another session's frames are dropped and counted") {
  HoldingRig rig;
  rig.send_as(99, Rig::relax(), rig.next_sequence);
  rig.run_frames(2);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.telemetry().rx_damaged == 1);
}

// ---------------------------------------------------------------- reliable commands

TEST_CASE("a repeated command is acknowledged, not carried out again") {
  HoldingRig rig;
  const protocol::Segments message = rig.segments({Rig::segment(10, 1800), Rig::segment(10, 1700)});
  rig.command(message);
  rig.run_frames(25);
  const size_t frame = rig.outputs.size() - 1;
  const size_t receipts = rig.receipts.size();
  rig.send(message, static_cast<uint8_t>(rig.next_sequence - 1));
  CHECK(rig.receipts.size() == receipts + 1);
  CHECK(rig.receipts.back().message.gap == 0);
  rig.run_frames(10);
  CHECK(frozen_since(rig, frame));
}

TEST_CASE("a command after a lost one is dropped, and the gap is told") {
  HoldingRig rig;
  rig.send(Rig::relax(), static_cast<uint8_t>(rig.next_sequence + 1));
  CHECK(rig.receipts.back().message.gap == 1);
  CHECK(rig.header.expected == rig.next_sequence);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.command(protocol::Disarm{}));
  CHECK(rig.receipts.back().message.gap == 0);
}

TEST_CASE("segments for which there is no room are not taken, and later they are") {
  HoldingRig rig;
  for (int i = 0; i < 10; ++i) {
    std::vector<protocol::Segment> five(5, Rig::segment(10, 1700));
    CHECK(rig.command(rig.segments(five)));
  }
  CHECK(rig.header.credit == 0);
  const protocol::Segments more = rig.segments({Rig::segment(10, 1750)});
  CHECK_FALSE(rig.command(more));
  CHECK(rig.refusals.empty());
  rig.run_frames(12);
  CHECK(rig.header.credit == 1);
  CHECK(rig.command(more));
  rig.run_frames(500);
  CHECK(rig.pulse() == 1750);
}

TEST_CASE("a second refusal waits until the first is acknowledged") {
  HoldingRig rig;
  CHECK(rig.command(Rig::enable()));
  CHECK(rig.last_refusal() == Refusal::kAlreadyEnabled);
  CHECK_FALSE(rig.command(kDefaultLimits));
  rig.run_frames(20);
  CHECK(rig.refusals.size() > 2);  // repeated
  CHECK(rig.refusals.back().message.command_type ==
        static_cast<uint8_t>(protocol::MessageType::kEnable));
  rig.acknowledge_all();
  const size_t heard = rig.refusals.size();
  rig.run_frames(20);
  CHECK(rig.refusals.size() == heard);
  CHECK(rig.command(kDefaultLimits));
  CHECK(rig.refusals.back().message.record_id == 2);
  rig.acknowledge_all();
  rig.send(protocol::Recall{static_cast<uint8_t>(Record::kRefusal)});
  CHECK(rig.refusals.back().message.record_id == 2);
}

// ---------------------------------------------------------------- pulses

TEST_CASE("servos attach one by one at the commanded pose, and detach together") {
  Rig rig;
  rig.open();
  rig.command(Rig::enable(2000));
  const size_t start = rig.outputs.size();
  rig.run_frames(25);
  CHECK(rig.state() == State::kHolding);
  int previous = 0;
  bool right = true;
  for (size_t i = start; i < rig.outputs.size(); ++i) {
    const int count = __builtin_popcount(rig.outputs[i].attached);
    right = right && count - previous <= 1 && count >= previous;
    right = right && rig.outputs[i].pulses.ticks[0] == 2000;
    previous = count;
  }
  CHECK(right);
  CHECK(rig.telemetry().attached == 0x0F);
  rig.command(protocol::Limp{});
  rig.run_frames(1);
  CHECK(rig.hal.attached() == 0);
  CHECK(rig.state() == State::kRelaxed);
}

TEST_CASE("relax unwinds at its speed to the free pose, then switches off") {
  Rig rig;
  rig.hold_at(kAway);
  const size_t start = rig.outputs.size();
  rig.command(Rig::relax(10));
  rig.run_frames(60);
  CHECK(rig.state() == State::kRelaxed);
  CHECK(rig.hal.attached() == 0);
  uint16_t last = kAway;
  int fastest = 0;
  for (size_t i = start; i < rig.outputs.size() && rig.outputs[i].attached; ++i) {
    fastest = std::max(fastest, abs(rig.outputs[i].pulses.ticks[0] - last));
    last = rig.outputs[i].pulses.ticks[0];
  }
  CHECK(last == kFree);
  CHECK(fastest == 10);
}

TEST_CASE("the queue plays straight through to its end, holds there, and needs no host") {
  HoldingRig rig;
  rig.command(
      rig.segments({Rig::segment(10, 1800), Rig::segment(20, 2000), Rig::segment(5, 2010)}));
  CHECK(rig.state() == State::kMoving);
  const size_t start = rig.outputs.size();
  rig.run_frames(50);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.outputs[start + 10].pulses.ticks[0] == 1800);
  CHECK(rig.outputs[start + 30].pulses.ticks[0] == 2000);
  CHECK(rig.outputs[start + 35].pulses.ticks[0] == 2010);
  CHECK(rig.pulse() == 2010);
  CHECK(rig.telemetry().underruns == 0);
  rig.command(rig.segments({Rig::segment(5, 2000)}));
  rig.run_frames(2);
  CHECK(rig.telemetry().underruns == 0);  // a new move, long after
}

TEST_CASE("segments that come just after the queue ran dry count as an underrun") {
  HoldingRig rig;
  rig.command(rig.segments({Rig::segment(5, 1750)}));
  rig.run_frames(8);
  rig.command(rig.segments({Rig::segment(5, 1800)}));
  rig.run_frames(8);
  CHECK(rig.telemetry().underruns == 1);
}

TEST_CASE("holding long without a host relaxes, if so set; a host that speaks prevents it") {
  Rig rig;
  rig.open();
  protocol::SetLimits limits = kDefaultLimits;
  limits.hold_timeout_s = 1;
  CHECK(rig.command(limits));
  rig.command(Rig::enable());
  rig.run_frames(25);
  for (int i = 0; i < 5; ++i) {
    rig.run_frames(40);
    rig.send(protocol::Ping{});
  }
  CHECK(rig.state() == State::kHolding);
  rig.run_frames(60);
  CHECK(rig.state() == State::kRelaxed);
  CHECK(rig.hal.attached() == 0);
}

// ---------------------------------------------------------------- refused motion

TEST_CASE(
    "motion that means nothing, leads too far or goes too fast is refused, and nothing moves") {
  HoldingRig rig;
  protocol::Segments message = rig.segments({Rig::segment(0, 1800)});
  SUBCASE("zero duration") {
    check_refused(rig, message, Refusal::kBadField);
  }
  SUBCASE("no segment") {
    message.count = 0;
    check_refused(rig, message, Refusal::kBadField);
  }
  SUBCASE("more segments than slots") {
    message.count = 6;
    check_refused(rig, message, Refusal::kBadField);
    message.epoch = rig.header.epoch;
    message.count = 255;
    check_refused(rig, message, Refusal::kBadField);
  }
  SUBCASE("a pulse of 0 or 65535") {
    for (uint16_t ticks : {0, 65535}) {
      check_refused(rig, rig.segments({Rig::segment(500, ticks)}), Refusal::kOutOfLimits);
    }
  }
  SUBCASE("opposite tendons") {
    const protocol::Segment bent = {500, {3000, 1700, 1700, 1700}};
    check_refused(rig, rig.segments({bent}), Refusal::kPairLimit);
  }
  SUBCASE("too fast") {
    check_refused(rig, rig.segments({Rig::segment(1, 1700 + 117)}), Refusal::kTooFast);
    CHECK(rig.refusals.back().message.index == 0);
  }
  SUBCASE("the last of five is wrong: none of them is played") {
    check_refused(
        rig,
        rig.segments({Rig::segment(10, 1800), Rig::segment(10, 1900), Rig::segment(10, 1800),
                      Rig::segment(10, 1900), Rig::segment(1, 2100)}),
        Refusal::kTooFast);
    CHECK(rig.refusals.back().message.index == 4);
  }
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
}

TEST_CASE("a refusal in mid-motion freezes, and what was sent before the host knew is discarded") {
  HoldingRig rig;
  const protocol::Segments stale = rig.segments({Rig::segment(20, 1800)});
  rig.command(rig.segments({Rig::segment(50, 1900)}));
  rig.run_frames(10);
  const size_t frame = rig.outputs.size() - 1;
  CHECK(rig.command(rig.segments({Rig::segment(1, 3000)})));
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.command(stale));
  rig.run_frames(20);
  CHECK(frozen_since(rig, frame));
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
}

TEST_CASE("an enable outside the limits switches nothing on") {
  Rig rig;
  rig.open();
  rig.command(Rig::enable(1000));
  CHECK(rig.last_refusal() == Refusal::kOutOfLimits);
  rig.run_frames(5);
  CHECK(rig.hal.attached() == 0);
}

// ---------------------------------------------------------------- stop

TEST_CASE("a stop freezes at the next frame, and nothing that is in flight moves again") {
  HoldingRig rig;
  const protocol::Segments stale = rig.segments({Rig::segment(20, 1800)});
  rig.command(rig.segments({Rig::segment(50, 1900)}));
  rig.run_frames(10);
  const size_t frame = rig.outputs.size() - 1;
  rig.send(protocol::Stop{1});
  CHECK(rig.state() == State::kStopped);
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
  CHECK(rig.command(stale));  // retransmitted: acknowledged, discarded
  CHECK(rig.refusals.empty());
  rig.run_frames(20);
  CHECK(frozen_since(rig, frame));
  CHECK(rig.telemetry().stop_number == 1);

  CHECK(rig.command(rig.resume()));
  CHECK(rig.state() == State::kHolding);
  rig.command(stale);
  rig.run_frames(20);
  CHECK(frozen_since(rig, frame));
  rig.command(rig.segments({Rig::segment(20, 1800)}));
  rig.run_frames(23);
  CHECK(rig.pulse() == 1800);
}

TEST_CASE("the same stop again is only acknowledged, the next one stops again") {
  HoldingRig rig;
  rig.send(protocol::Stop{1});
  rig.command(rig.resume());
  const uint8_t epoch = rig.header.epoch;
  const size_t receipts = rig.receipts.size();
  rig.send(protocol::Stop{1});
  CHECK(rig.receipts.size() == receipts + 1);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.header.epoch == epoch);
  rig.send(protocol::Stop{2});
  CHECK(rig.state() == State::kStopped);
}

TEST_CASE("a stop counts whoever sends it, even with a number that another host used") {
  HoldingRig rig;
  rig.send(protocol::Stop{1});
  rig.command(rig.resume());
  rig.send_as(99, protocol::Stop{1});
  CHECK(rig.state() == State::kStopped);
  rig.open(8);
  rig.command(rig.resume());
  CHECK(rig.state() == State::kHolding);
  rig.send(protocol::Stop{1});
  CHECK(rig.state() == State::kStopped);
}

TEST_CASE("a resume that answers an older stop is refused") {
  HoldingRig rig;
  rig.send(protocol::Stop{1});
  const protocol::Resume old = rig.resume();
  rig.send(protocol::Stop{2});
  rig.command(old);
  CHECK(rig.last_refusal() == Refusal::kWrongEpoch);
  CHECK(rig.state() == State::kStopped);
}

TEST_CASE("a stop behind a full line of segments is acted on as soon as it arrives") {
  HoldingRig rig;
  for (int i = 0; i < 10; ++i) {
    rig.command(rig.segments(std::vector<protocol::Segment>(5, Rig::segment(10, 1800))));
  }
  rig.run_frames(2);
  const size_t frame = rig.outputs.size() - 1;
  rig.send(protocol::Stop{1});
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
  rig.run_frames(5);
  CHECK(frozen_since(rig, frame));
}

// ---------------------------------------------------------------- contact

TEST_CASE("segments behind a guard wait until it is armed") {
  HoldingRig rig;
  CHECK(rig.command(rig.guard()));
  CHECK(rig.command(rig.segments({Rig::segment(20, 1800)})));
  rig.run_frames(2);
  CHECK(rig.telemetry().guard == static_cast<uint8_t>(Guard::kTaring));
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.pulse() == kFree);
  rig.run_frames(8);
  CHECK(rig.telemetry().guard == static_cast<uint8_t>(Guard::kArmed));
  CHECK(rig.state() == State::kMoving);
  rig.run_frames(25);
  CHECK(rig.pulse() == 1800);
}

TEST_CASE("a contact in mid-motion freezes within one frame, and the record says when and where") {
  HoldingRig rig;
  rig.command(rig.guard());
  rig.command(rig.segments({Rig::segment(100, kAway)}));
  rig.run_frames(30);
  REQUIRE(rig.state() == State::kMoving);
  const uint8_t epoch = rig.header.epoch;

  rig.pressure_raw = kTouch;
  while (rig.trips.empty())
    rig.run_until(rig.hal.board_us() + kStepUs);
  const size_t frame = rig.outputs.size() - 1;
  const uint64_t seen_us = rig.hal.board_us();
  const protocol::Trip trip = rig.trips.back().message;
  CHECK(trip.record_id == 1);
  CHECK(trip.cause == static_cast<uint8_t>(TripCause::kContact));
  CHECK(trip.pressure_raw == kTouch);
  CHECK(trip.baseline_raw == kRest);
  const uint64_t sampled_us =
      uint64_t(trip.sample_frame) * protocol::kServoFrameUs + trip.sample_phase_us;
  CHECK(sampled_us <= seen_us);
  CHECK(seen_us - sampled_us <= kStepUs);
  for (int back = 0; back < 4; ++back) {
    for (int servo = 0; servo < 4; ++servo) {
      CHECK(trip.pulse_ticks[3 - back][servo] == rig.outputs[frame - back].pulses.ticks[servo]);
    }
  }
  CHECK(trip.pulse_ticks[2][0] < trip.pulse_ticks[3][0]);  // it was moving

  rig.run_frames(20);
  CHECK(frozen_since(rig, frame));
  CHECK(rig.state() == State::kTripped);
  CHECK(rig.header.epoch == static_cast<uint8_t>(epoch + 1));
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
  CHECK(rig.telemetry().guard == static_cast<uint8_t>(Guard::kOff));
}

TEST_CASE("the reflex retracts in a straight line at its speed, without the host") {
  Rig rig;
  rig.hold_at(kAway);
  protocol::GuardMessage guard = rig.guard(Reflex::kRetract);
  guard.retract_ticks[0] = 1700;
  guard.retract_ticks[1] = 1950;
  guard.retract_ticks[2] = 2200;
  guard.retract_ticks[3] = 2199;
  guard.retract_slew_ticks = 50;
  rig.command(guard);
  rig.run_frames(12);
  rig.pressure_raw = kTouch;
  while (rig.trips.empty())
    rig.run_until(rig.hal.board_us() + kStepUs);
  const size_t frame = rig.outputs.size() - 1;
  rig.run_frames(5);
  CHECK(rig.telemetry().reflex_running == 1);
  CHECK(rig.state() == State::kTripped);
  rig.run_frames(10);
  CHECK(rig.telemetry().reflex_running == 0);
  CHECK(rig.state() == State::kTripped);
  CHECK(rig.pulse(0) == 1700);
  CHECK(rig.pulse(1) == 1950);
  CHECK(rig.pulse(2) == 2200);
  CHECK(rig.pulse(3) == 2199);
  int moving_frames = 0;
  bool straight = true;
  for (size_t i = frame + 1; i < rig.outputs.size(); ++i) {
    const Pulses& now = rig.outputs[i].pulses;
    const int step = rig.outputs[i - 1].pulses.ticks[0] - now.ticks[0];
    moving_frames += step != 0;
    straight =
        straight && step <= 50 && abs((2200 - now.ticks[0]) - 2 * (2200 - now.ticks[1])) <= 2;
  }
  CHECK(straight);
  CHECK(moving_frames == 10);
}

TEST_CASE("resume waits for the reflex's end and the record's acknowledgement") {
  Rig rig;
  rig.hold_at(kAway);
  rig.arm(Reflex::kRetract);
  rig.pressure_raw = kTouch;
  rig.run_frames(5);
  rig.command(rig.resume());
  CHECK(rig.last_refusal() == Refusal::kReflexRunning);
  rig.acknowledge(Record::kRefusal, rig.refusals.back().message.record_id);
  rig.pressure_raw = kRest;
  rig.run_frames(40);
  rig.command(rig.resume());
  CHECK(rig.last_refusal() == Refusal::kRecordPending);
  rig.acknowledge_all();
  CHECK(rig.command(rig.resume()));
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("a trip is repeated until acknowledged, and read again by a host that comes later") {
  HoldingRig rig;
  rig.arm();
  rig.pressure_raw = kTouch;
  rig.run_frames(20);
  CHECK(rig.trips.size() >= 3);
  rig.open(8);
  const size_t heard = rig.trips.size();
  rig.run_frames(10);
  CHECK(rig.trips.size() > heard);
  rig.acknowledge_all();
  const size_t acknowledged = rig.trips.size();
  rig.run_frames(20);
  CHECK(rig.trips.size() == acknowledged);
  rig.send(protocol::Recall{static_cast<uint8_t>(Record::kTrip)});
  CHECK(rig.trips.size() == acknowledged + 1);
}

TEST_CASE("a guarded move that is never ended trips at its deadline, and stays where it is") {
  Rig rig;
  rig.hold_at(kAway);
  protocol::GuardMessage guard = rig.guard(Reflex::kRetract);
  guard.deadline_frames = 30;
  rig.command(guard);
  rig.run_frames(60);
  CHECK(rig.state() == State::kTripped);
  REQUIRE(!rig.trips.empty());
  CHECK(rig.trips[0].message.cause == static_cast<uint8_t>(TripCause::kDeadline));
  CHECK(rig.pulse() == kAway);
}

TEST_CASE("a disarmed guard does not trip") {
  HoldingRig rig;
  rig.arm();
  CHECK(rig.command(protocol::Disarm{}));
  rig.pressure_raw = kTouch;
  rig.run_frames(20);
  CHECK(rig.trips.empty());
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("segments that wait for a guard can't be run without it") {
  HoldingRig rig;
  rig.command(rig.guard());
  rig.command(rig.segments({Rig::segment(20, 1800)}));
  rig.command(protocol::Disarm{});
  CHECK(rig.last_refusal() == Refusal::kBusy);
  CHECK(rig.pulse() == kFree);
}

TEST_CASE("a guard with a bad tare is refused by its own number, and its segments are dropped") {
  HoldingRig rig;
  const uint8_t sequence = rig.next_sequence;
  rig.pressure_raw = kTouch;
  rig.command(rig.guard());
  rig.command(rig.segments({Rig::segment(20, 1800)}));
  rig.run_frames(30);
  REQUIRE(!rig.refusals.empty());
  CHECK(rig.refusals[0].message.command_sequence == sequence);
  CHECK(rig.last_refusal() == Refusal::kTareFar);
  CHECK(rig.pulse() == kFree);
  CHECK(rig.header.credit == protocol::kSegmentQueueSlots);
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("guards that can't guard are refused") {
  HoldingRig rig;
  protocol::GuardMessage guard = rig.guard(Reflex::kRetract);
  Refusal reason = Refusal::kBadField;
  SUBCASE("no threshold") {
    guard.threshold_raw = 0;
  }
  SUBCASE("no sample") {
    guard.consecutive = 0;
  }
  SUBCASE("too many samples") {
    guard.consecutive = 9;
  }
  SUBCASE("no deadline") {
    guard.deadline_frames = 0;
  }
  SUBCASE("unknown reflex") {
    guard.reflex = 2;
  }
  SUBCASE("retract at no speed") {
    guard.retract_slew_ticks = 0;
  }
  SUBCASE("retract too fast") {
    guard.retract_slew_ticks = 1000;
    reason = Refusal::kTooFast;
  }
  SUBCASE("retract out of the limits") {
    guard.retract_ticks[1] = 5000;
    reason = Refusal::kOutOfLimits;
  }
  SUBCASE("blinder than unguarded motion") {
    guard.threshold_raw = 61 * kHpa;
    reason = Refusal::kOutOfLimits;
  }
  check_refused(rig, guard, reason);
}

TEST_CASE("a guard is refused without a sensor") {
  HoldingRig rig;
  rig.sensor = Sensor::kAbsent;
  rig.run_frames(2);
  check_refused(rig, rig.guard(), Refusal::kSensorUnavailable);
}

// A stop after a trip could be resumed from, and the next trip took the unread one's place.
TEST_CASE("with an unread trip nothing moves again, though a stop came after it") {
  HoldingRig rig;
  rig.arm();
  rig.pressure_raw = kTouch;
  rig.run_frames(3);
  rig.pressure_raw = kRest;
  rig.send(protocol::Stop{1});
  check_refused(rig, rig.resume(), Refusal::kRecordPending);
  CHECK(rig.command(rig.resume()));
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("an unguarded move that presses hard is stopped too") {
  HoldingRig rig;
  rig.command(rig.segments({Rig::segment(100, kAway)}));
  rig.run_frames(10);
  rig.pressure_raw = kRest + 70 * kHpa;
  rig.run_frames(3);
  CHECK(rig.state() == State::kTripped);
  REQUIRE(!rig.trips.empty());
  CHECK(rig.trips[0].message.cause == static_cast<uint8_t>(TripCause::kCoarseContact));
}

// ---------------------------------------------------------------- faults

TEST_CASE("an armed board that loses its sensor faults; resume needs the sensor back") {
  const Sensor lost[] = {Sensor::kAbsent, Sensor::kWrong, Sensor::kBus};
  for (Sensor sensor : lost) {
    HoldingRig rig;
    rig.command(rig.guard());
    rig.command(rig.segments({Rig::segment(100, kAway)}));
    rig.run_frames(20);
    const size_t frame = rig.outputs.size() - 1;
    rig.sensor = sensor;
    rig.run_until(rig.hal.board_us() + kStepUs);
    CHECK(rig.state() == State::kFault);
    rig.run_frames(10);
    CHECK(frozen_since(rig, frame));
    REQUIRE(!rig.faults.empty());
    CHECK(rig.faults[0].message.fault == static_cast<uint8_t>(sensor));

    rig.command(rig.resume());
    CHECK(rig.last_refusal() == Refusal::kRecordPending);
    rig.acknowledge_all();
    rig.command(rig.resume());
    CHECK(rig.last_refusal() == Refusal::kFault);
    rig.acknowledge_all();
    rig.sensor = Sensor::kOk;
    rig.run_frames(3);
    CHECK(rig.command(rig.resume()));
    CHECK(rig.state() == State::kHolding);
  }
}

TEST_CASE("a sensor that goes silent, or out of its range, faults while armed") {
  HoldingRig rig;
  rig.arm();
  SUBCASE("silent") {
    const uint64_t until_us = rig.hal.board_us() + 7 * protocol::kServoFrameUs;
    while (rig.hal.board_us() < until_us) {
      rig.hal.advance_to(rig.hal.board_us() + kStepUs);
      rig.poll();
    }
    CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(Fault::kSensorSilent));
  }
  SUBCASE("out of range") {
    rig.pressure_raw = 1261 * kHpa;
    rig.run_frames(2);
    CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(Fault::kSensorRange));
  }
  CHECK(rig.state() == State::kFault);
}

TEST_CASE("without a guard a lost sensor stops nothing, and is told") {
  HoldingRig rig;
  rig.command(rig.segments({Rig::segment(30, 1800)}));
  rig.sensor = Sensor::kAbsent;
  rig.run_frames(40);
  CHECK(rig.pulse() == 1800);
  CHECK(rig.telemetry().sensor == static_cast<uint8_t>(Sensor::kAbsent));
}

TEST_CASE("a stop in fault stays in fault and discards what is in flight") {
  HoldingRig rig;
  rig.arm();
  rig.sensor = Sensor::kAbsent;
  rig.run_frames(2);
  const uint8_t epoch = rig.header.epoch;
  rig.send(protocol::Stop{1});
  CHECK(rig.state() == State::kFault);
  CHECK(rig.header.epoch == static_cast<uint8_t>(epoch + 1));
}

TEST_CASE("after a reset there is no session and no pulse, but the pose is known") {
  Rig rig;
  rig.hold_at(kAway);
  rig.restart(ResetCause::kExternal);
  CHECK(rig.hal.attached() == 0);
  rig.send_as(7, Rig::enable(kAway), 0);  // of the session before
  rig.run_frames(3);
  CHECK(rig.hal.attached() == 0);
  rig.open(9);
  const protocol::HelloReply& reply = rig.hellos.back().message;
  CHECK(reply.reset_cause == static_cast<uint8_t>(ResetCause::kExternal));
  CHECK(reply.previous_session == 0);
  CHECK(reply.pose_known == 1);
  CHECK(reply.pulse_ticks[0] == kAway);
  CHECK(rig.state() == State::kRelaxed);
}

TEST_CASE("an unknown pose is known once all servos had pulses") {
  Rig rig;
  rig.hal.forget_pose();
  rig.open();
  CHECK(rig.hellos.back().message.pose_known == 0);
  rig.command(Rig::enable(1900));
  rig.run_frames(10);
  CHECK_FALSE(rig.hal.retained().pose.value.known);
  rig.run_frames(15);
  CHECK(rig.hal.retained().pose.value.known);
  CHECK(rig.hal.retained().pose.value.pulses.ticks[2] == 1900);
}

TEST_CASE("a watchdog or brown-out reset is a latched fault") {
  const struct {
    ResetCause cause;
    Fault fault;
  } cases[] = {{ResetCause::kWatchdog, Fault::kWatchdog},
               {ResetCause::kBrownOut, Fault::kSupplyLow}};
  for (const auto& c : cases) {
    Rig rig;
    rig.restart(c.cause);
    rig.open();
    CHECK(rig.state() == State::kFault);
    rig.run_frames(6);
    REQUIRE(!rig.faults.empty());
    CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(c.fault));
    rig.acknowledge_all();
    CHECK(rig.command(rig.resume()));
    CHECK(rig.state() == State::kRelaxed);
  }
}

// ---------------------------------------------------------------- line

TEST_CASE("frames that are damaged, short or unknown are counted and do nothing") {
  HoldingRig rig;
  uint8_t unknown[protocol::kFrameBytesMax] = {0x77, 7, 0, 1, 2};
  rig.send_raw(unknown, 5);
  uint8_t brief[protocol::kFrameBytesMax] = {0x02, 7};
  rig.send_raw(brief, 2);
  uint8_t wrong_length[protocol::kFrameBytesMax] = {0x02, 7, 0, 1, 2};
  rig.send_raw(wrong_length, 5);
  for (uint8_t byte : {0x05, 0x01, 0x02, 0x00})
    rig.hal.push_rx(byte);
  rig.run_frames(2);
  CHECK(rig.telemetry().rx_damaged == 4);
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("a line that nobody empties loses telemetry, not records") {
  HoldingRig rig;
  rig.arm();
  rig.pressure_raw = kTouch;
  const uint64_t until_us = rig.hal.board_us() + 50 * protocol::kServoFrameUs;
  while (rig.hal.board_us() < until_us) {  // the line is blocked
    rig.hal.push_sample(Sensor::kOk, kTouch, rig.hal.board_us());
    rig.hal.advance_to(rig.hal.board_us() + 4000);
    rig.board->poll();
  }
  rig.run_frames(5);
  CHECK(rig.malformed == 0);
  REQUIRE(!rig.trips.empty());
  CHECK(rig.trips.back().message.record_id == 1);
}

TEST_CASE("telemetry comes once a frame, numbered, with each sample once") {
  HoldingRig rig;
  const size_t first = rig.telemetries.size();
  rig.run_frames(100);
  CHECK(rig.telemetries.size() == first + 100);
  int samples = 0;
  bool numbered = true;
  int others = 0;
  for (size_t i = first; i < rig.telemetries.size(); ++i) {
    const uint8_t step =
        rig.telemetries[i].header.sequence - rig.telemetries[i - 1].header.sequence;
    others += step - 1;
    samples += rig.telemetries[i].message.sample_count;
    numbered =
        numbered && rig.telemetries[i].message.frame == rig.telemetries[i - 1].message.frame + 1;
  }
  CHECK(others == 2);  // the status, once a second
  CHECK(numbered);
  CHECK(samples >= 146);  // 75 Hz for 2 s, in steps of 0.5 ms
  CHECK(samples <= 151);
}
