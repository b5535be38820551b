// What the board watches by itself: the stop switch, the samples' worth, its own line.
#include <doctest/doctest.h>

#include "../support/rig.h"
#include "contact/sample_judge.h"

using namespace setae;
using protocol::Fault;
using protocol::Refusal;
using protocol::Sensor;
using protocol::State;

namespace {

constexpr uint16_t kAway = 2200;

protocol::SetLimits limits_with_switch() {
  protocol::SetLimits limits = kDefaultLimits;
  limits.stop_switch = 1;
  return limits;
}

}  // namespace

// ---------------------------------------------------------------- stop switch

TEST_CASE("a stop switch that opens stops the robot within two frames, until it is closed") {
  Rig rig;
  rig.hal.set_stop_switch(false);
  rig.open();
  CHECK(rig.command(limits_with_switch()));
  rig.command(Rig::enable());
  rig.run_frames(25);
  rig.command(rig.segments({Rig::segment(100, kAway)}));
  rig.run_frames(10);
  rig.hal.set_stop_switch(true);
  rig.run_frames(2);
  const uint16_t held = rig.pulse();
  CHECK(rig.state() == State::kStopped);
  rig.run_frames(20);
  CHECK(rig.pulse() == held);
  rig.command(rig.resume());
  CHECK(rig.last_refusal() == Refusal::kStopSwitch);
  rig.acknowledge_all();
  rig.hal.set_stop_switch(false);
  rig.run_frames(1);
  CHECK(rig.state() == State::kStopped);  // closing it moves nothing
  CHECK(rig.command(rig.resume()));
  CHECK(rig.state() == State::kHolding);
}

TEST_CASE("a spark is no open switch, and a board without one works") {
  Rig rig;
  SUBCASE("spark") {
    rig.hal.set_stop_switch(false);
    rig.open();
    rig.command(limits_with_switch());
    rig.command(Rig::enable());
    rig.run_frames(25);
    rig.hal.set_stop_switch(true);
    for (int poll = 0; poll < 14; ++poll)
      rig.poll();
    rig.hal.set_stop_switch(false);
    rig.run_frames(5);
  }
  SUBCASE("none") {
    rig.hold();
  }
  CHECK(rig.state() == State::kHolding);
}

// ---------------------------------------------------------------- samples

TEST_CASE("a sensor whose value is frozen bit by bit, or jumps up and down, faults while armed") {
  Rig rig;
  rig.hold();
  rig.arm();
  Fault expected = Fault::kNone;
  int samples = 0;
  SUBCASE("stuck") {
    expected = Fault::kSensorStuck;
    while (rig.state() == State::kHolding && samples < 100) {
      rig.hal.push_sample(Sensor::kOk, 1013 * kHpa + 7, rig.hal.board_us());
      ++samples;
      rig.hal.advance_to(rig.hal.board_us() + kSampleUs);
      rig.poll();
    }
    CHECK(samples <= protocol::kSensorStuckSamples + 1);
  }
  SUBCASE("noisy") {
    expected = Fault::kSensorNoisy;
    while (rig.state() == State::kHolding && samples < 100) {
      rig.hal.push_sample(Sensor::kOk, 1013 * kHpa + (samples % 2 ? 4 : -4) * kHpa,
                          rig.hal.board_us());
      ++samples;
      rig.hal.advance_to(rig.hal.board_us() + kSampleUs);
      rig.poll();
    }
    CHECK(samples < 15);
  }
  CHECK(rig.state() == State::kFault);
  REQUIRE(!rig.faults.empty());
  CHECK(rig.faults.back().message.fault == static_cast<uint8_t>(expected));
}

TEST_CASE("a slow change, a contact and a swing are believed; a spike, too") {
  SampleJudge judge;
  int32_t raw = 1013 * kHpa;
  const auto take = [&](int32_t change) { return judge.take(raw += change); };
  for (int i = 0; i < 200; ++i)
    CHECK(take(i % 8 == 0 ? 1 : 0) == Sensor::kOk);
  CHECK(take(40 * kHpa) == Sensor::kOk);
  for (int i = 0; i < 10; ++i)
    CHECK(take(3) == Sensor::kOk);
  CHECK(take(-40 * kHpa) == Sensor::kOk);
  CHECK(take(100 * kHpa) == Sensor::kOk);
  CHECK(take(-100 * kHpa) == Sensor::kOk);
  // A bristle that swings at 15 Hz by 10 hPa, for half a second.
  const int swing[] = {0, 10, 6, -6, -10};
  for (int i = 0; i < 40; ++i)
    CHECK(judge.take(raw + swing[i % 5] * kHpa * (40 - i) / 40) == Sensor::kOk);
  CHECK(judge.take(259 * kHpa) == Sensor::kRange);
  CHECK(judge.take(1261 * kHpa) == Sensor::kRange);
}

TEST_CASE("a noisy sensor is believed again after half a second of quiet") {
  SampleJudge judge;
  Sensor sensor = Sensor::kOk;
  for (int i = 0; i < 20; ++i)
    sensor = judge.take((1013 + (i % 2 ? 10 : -10)) * kHpa);
  CHECK(sensor == Sensor::kNoisy);
  for (int i = 0; i < 38; ++i)
    sensor = judge.take(1013 * kHpa + i);
  CHECK(sensor == Sensor::kOk);
}

// ---------------------------------------------------------------- line

TEST_CASE("what the hardware noticed is told once a second") {
  Rig rig;
  rig.open();
  rig.hal.errors() = {3, 4, 5};
  rig.hal.late() = 6;
  rig.run_frames(2 * protocol::kStatusFrames + 1);
  const protocol::Status& status = rig.statuses.back().message;
  CHECK(rig.statuses.size() == 3);  // and when the session opened
  CHECK(status.rx_framing_errors == 3);
  CHECK(status.rx_overruns == 4);
  CHECK(status.rx_overflows == 5);
  CHECK(status.late_pulses == 6);
  CHECK(status.supply_mv / 100 == 50);
  CHECK(status.stop_switch_open == 1);
}

// Answers went before telemetry: a host that asked without a break got nothing else.
TEST_CASE("a host that asks at the line's full rate still gets each telemetry and record") {
  Rig rig;
  rig.hold();
  rig.arm();
  const size_t first = rig.telemetries.size();
  const size_t pongs = rig.pongs.size();
  const uint32_t byte_us = 10000000UL / protocol::kBaud;
  uint8_t frame[protocol::kFrameBytesMax] = {static_cast<uint8_t>(protocol::Ping::kType), 7, 0};
  encode(protocol::Ping{7}, frame + protocol::HostHeader::kSize);
  uint8_t wire[protocol::kFrameWireBytesMax];
  const uint8_t size =
      protocol::encode_frame(frame, protocol::HostHeader::kSize + protocol::Ping::kSize, wire);
  const uint64_t begin_us = rig.hal.board_us();
  uint64_t sample_us = begin_us;
  for (uint32_t i = 0; rig.hal.board_us() < begin_us + 1000000; ++i) {
    if (rig.hal.board_us() >= sample_us) {
      const int32_t touch = rig.hal.board_us() > begin_us + 500000 ? 30 * kHpa : 0;
      rig.hal.push_sample(Sensor::kOk, 1013 * kHpa + touch + (i & 1), rig.hal.board_us());
      sample_us += kSampleUs;
    }
    rig.hal.advance_to(rig.hal.board_us() + byte_us);
    rig.hal.push_rx(wire[i % size]);
    rig.board->poll();
    uint8_t byte;
    if (rig.hal.pop_tx(byte))
      rig.take(byte);
  }
  CHECK(rig.pongs.size() - pongs > 500);
  CHECK(rig.telemetries.size() - first >= 49);
  REQUIRE(!rig.trips.empty());
  CHECK(rig.trips.size() >= 5);  // repeated every five frames
}
