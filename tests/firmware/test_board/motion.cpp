// What the servos get: attaching, segments, and motion that is refused.
#include <doctest/doctest.h>
#include <stdlib.h>

#include <algorithm>

#include "../support/holding_rig.h"

using namespace setae;
using protocol::Refusal;
using protocol::State;

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
  const size_t start = rig.outputs.size() - 1;
  rig.run_frames(50);
  CHECK(rig.state() == State::kHolding);
  CHECK(rig.outputs[start + 1].pulses.ticks[0] == 1710);  // a tenth of the way, at once
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
