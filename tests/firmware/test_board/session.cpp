// Handshake, session, reliable commands and the line, as a host sees them.
#include <doctest/doctest.h>

#include <algorithm>

#include "../support/holding_rig.h"
#include "protocol/crc32c.h"

using namespace setae;
using protocol::Record;
using protocol::Refusal;
using protocol::Sensor;
using protocol::State;

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
  rig.poll();
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
