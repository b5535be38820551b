// A stop, and what follows.
#include <doctest/doctest.h>

#include <algorithm>

#include "../support/holding_rig.h"

using namespace setae;
using protocol::Refusal;
using protocol::State;

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
