// From a touch to a stop, and what may move afterwards.
#include <doctest/doctest.h>
#include <stdlib.h>

#include "../support/holding_rig.h"

using namespace setae;
using protocol::Guard;
using protocol::Record;
using protocol::Reflex;
using protocol::Refusal;
using protocol::Sensor;
using protocol::State;
using protocol::TripCause;

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
