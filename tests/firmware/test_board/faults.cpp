// What breaks, and what a reset leaves.
#include <doctest/doctest.h>

#include "../support/holding_rig.h"

using namespace setae;
using protocol::Fault;
using protocol::Refusal;
using protocol::ResetCause;
using protocol::Sensor;
using protocol::State;

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
