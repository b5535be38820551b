#include <doctest/doctest.h>
#include <stdlib.h>

#include <random>

#include "board/default_limits.h"
#include "motion/attacher.h"
#include "motion/distance.h"
#include "motion/limits.h"
#include "motion/player.h"

using namespace setae;
using protocol::Refusal;
using protocol::Segment;

namespace {

Pulses pulses_of(uint16_t a, uint16_t b, uint16_t c, uint16_t d) {
  return {{a, b, c, d}};
}

Limits default_limits() {
  Limits limits;
  Verdict verdict;
  limits.set(kDefaultLimits, verdict);
  return limits;
}

Verdict pose_verdict(const Limits& limits, const Pulses& pose) {
  Verdict verdict;
  const bool ok = limits.check_pose(pose.ticks, verdict);
  CHECK(ok == verdict.ok());
  return verdict;
}

Verdict line_verdict(const Limits& limits, const Pulses& from, const Pulses& to, uint16_t frames,
                     uint8_t index) {
  Verdict verdict;
  const bool ok = limits.check_line(from.ticks, to.ticks, frames, index, verdict);
  CHECK(ok == verdict.ok());
  return verdict;
}

// What is wrong with a played line, in words; empty where nothing is.
const char* fault_of_line(const Pulses& from, const Segment& segment) {
  Line line;
  line.start(from, segment.target_ticks, segment.duration_frames);
  Pulses now = from;
  const uint32_t n = segment.duration_frames;
  for (uint32_t k = 1; k <= n; ++k) {
    if (!line.running())
      return "ends early";
    const Pulses before = now;
    line.step(now);
    for (uint8_t i = 0; i < 4; ++i) {
      const int64_t d = int64_t(segment.target_ticks[i]) - from.ticks[i];
      const double exact = from.ticks[i] + double(d) * k / n;
      if (std::abs(now.ticks[i] - exact) > 0.5 + 1e-9)
        return "off the line";
      const int step = int(now.ticks[i]) - before.ticks[i];
      if (int64_t(step) * d < 0)
        return "goes back";
      if (std::abs(step) > (std::abs(d) + n - 1) / n)
        return "too fast";
    }
  }
  if (line.running())
    return "ends late";
  for (uint8_t i = 0; i < 4; ++i) {
    if (now.ticks[i] != segment.target_ticks[i])
      return "ends elsewhere";
  }
  return "";
}

}  // namespace

TEST_CASE("a line is straight to half a tick, monotone, and ends exactly") {
  const Pulses from = pulses_of(1700, 3000, 2000, 2500);
  CHECK(fault_of_line(from, {1, {1750, 2950, 2000, 2501}}) == std::string());
  CHECK(fault_of_line(from, {7, {1800, 2900, 2000, 2501}}) == std::string());
  CHECK(fault_of_line(from, {50, {1701, 2999, 2003, 2500}}) == std::string());
  CHECK(fault_of_line(pulses_of(1000, 5000, 1000, 5000), {65535, {5000, 1000, 1001, 4999}}) ==
        std::string());
  std::mt19937 random(1);
  std::string worst;
  for (int i = 0; i < 2000 && worst.empty(); ++i) {
    const auto ticks = [&] { return uint16_t(1000 + random() % 4001); };
    const Pulses start = pulses_of(ticks(), ticks(), ticks(), ticks());
    const Segment segment = {uint16_t(1 + random() % 400), {ticks(), ticks(), ticks(), ticks()}};
    worst = fault_of_line(start, segment);
  }
  CHECK(worst == "");
}

TEST_CASE("a thousand segments there and back drift by nothing") {
  Player player;
  Pulses now = pulses_of(1700, 1700, 1700, 1700);
  for (int i = 0; i < 1000; ++i) {
    player.push({7, {1801, 1777, 1702, 1700}});
    player.push({3, {1700, 1700, 1700, 1700}});
    int frames = 0;
    while (player.step(now))
      ++frames;
    REQUIRE(frames == 10);
  }
  CHECK(now.ticks[0] == 1700);
  CHECK(now.ticks[1] == 1700);
  CHECK(now.ticks[2] == 1700);
  CHECK(now.ticks[3] == 1700);
}

TEST_CASE("segments follow each other without a pause, and the last end stays") {
  Player player;
  Pulses now = pulses_of(2000, 2000, 2000, 2000);
  player.push({2, {2010, 2010, 2010, 2010}});
  player.push({2, {2040, 2040, 2040, 2040}});
  const uint16_t expected[] = {2005, 2010, 2025, 2040};
  for (uint16_t ticks : expected) {
    CHECK(player.step(now));
    CHECK(now.ticks[0] == ticks);
  }
  CHECK(player.queued() == 1);  // its end is not put out yet
  CHECK_FALSE(player.step(now));
  CHECK(player.queued() == 0);
  CHECK(now.ticks[0] == 2040);
}

TEST_CASE("the queue holds what the protocol promises, in order, around its end") {
  SegmentQueue queue;
  uint16_t in = 0;
  uint16_t out = 0;
  bool in_order = true;
  for (int round = 0; round < 7; ++round) {
    while (queue.room() > 0)
      queue.push({++in, {}});
    CHECK(queue.size() == protocol::kSegmentQueueSlots);
    in_order = in_order && queue.back().duration_frames == in;
    for (int i = 0; i < 33; ++i) {
      in_order = in_order && queue.front().duration_frames == ++out;
      queue.pop();
    }
  }
  CHECK(in_order);
}

TEST_CASE("a planned line takes the frames that its fastest servo needs") {
  Line line;
  Pulses now = pulses_of(1700, 1700, 1700, 1700);
  const uint16_t to[] = {1800, 1725, 1700, 1701};
  line.start_at_slew(now, to, 30);
  int frames = 0;
  uint16_t fastest = 0;
  while (line.running()) {
    const Pulses before = now;
    line.step(now);
    const uint16_t step = longest_distance(before.ticks, now.ticks);
    if (step > fastest)
      fastest = step;
    ++frames;
  }
  CHECK(frames == 4);
  CHECK(fastest <= 30);
  CHECK(now.ticks[1] == 1725);
}

TEST_CASE("servos attach one at a time") {
  Attacher attacher;
  attacher.start();
  uint8_t attached = 0;
  int frames = 0;
  int most_at_once = 0;
  while (true) {
    const uint8_t before = attached;
    if (attacher.step(attached))
      break;
    const int added = __builtin_popcount(attached) - __builtin_popcount(before);
    if (added > most_at_once)
      most_at_once = added;
    ++frames;
  }
  CHECK(attached == kAllServos);
  CHECK(most_at_once == 1);
  CHECK(frames == 4 * protocol::kAttachIntervalFrames);
}

TEST_CASE("the built-in limits are consistent, and allow the free pose") {
  Limits limits;
  Verdict verdict;
  CHECK(limits.set(kDefaultLimits, verdict));
  CHECK(pose_verdict(limits, pulses_of(1700, 1700, 1700, 1700)).ok());
}

TEST_CASE("each servo's range is checked, at its ends too") {
  const Limits limits = default_limits();
  Pulses pose = pulses_of(2000, 2000, 2000, 2000);
  for (uint8_t i = 0; i < 4; ++i) {
    pose = pulses_of(2000, 2000, 2000, 2000);
    pose.ticks[i] = kDefaultLimits.pulse_min_ticks[i] - 1;
    const Verdict low = pose_verdict(limits, pose);
    CHECK(low.reason == Refusal::kOutOfLimits);
    CHECK(low.index == i);
    CHECK(low.value == pose.ticks[i]);
    CHECK(low.limit == kDefaultLimits.pulse_min_ticks[i]);
    pose.ticks[i] = kDefaultLimits.pulse_max_ticks[i] + 1;
    CHECK(pose_verdict(limits, pose).limit == kDefaultLimits.pulse_max_ticks[i]);
    pose.ticks[i] = 65535;
    CHECK(pose_verdict(limits, pose).reason == Refusal::kOutOfLimits);
  }
}

TEST_CASE("opposite tendons are checked together though each is in range") {
  const Limits limits = default_limits();
  const uint16_t high = kDefaultLimits.pulse_max_ticks[0] - 1;  // both wound up: crushes
  const Verdict crushed = pose_verdict(limits, pulses_of(high, 2000, high, 2000));
  CHECK(crushed.reason == Refusal::kPairLimit);
  CHECK(crushed.index == 0);
  CHECK(crushed.value == 2 * high);
  CHECK(crushed.limit == kDefaultLimits.pair_sum_max_ticks[0]);

  const uint16_t apart = kDefaultLimits.pair_difference_max_ticks[1] + 1;  // bends too far
  const Verdict bent = pose_verdict(limits, pulses_of(2000, 1700 + apart, 2000, 1700));
  CHECK(bent.reason == Refusal::kPairLimit);
  CHECK(bent.index == 1);
  CHECK(bent.value == apart);
  const Verdict other_way = pose_verdict(limits, pulses_of(2000, 1700, 2000, 1700 + apart));
  CHECK(other_way.value == -int32_t(apart));
  CHECK(other_way.limit == kDefaultLimits.pair_difference_min_ticks[1]);
}

TEST_CASE("a line may be as fast as the slew limit, not faster") {
  const Limits limits = default_limits();
  const uint16_t slew = kDefaultLimits.slew_ticks;
  const Pulses from = pulses_of(1700, 1700, 1700, 1700);
  const Pulses to = pulses_of(1700, 1700 + 3 * slew, 1700, 1700);
  CHECK(line_verdict(limits, from, to, 3, 4).ok());
  const Verdict fast = line_verdict(limits, from, to, 2, 4);
  CHECK(fast.reason == Refusal::kTooFast);
  CHECK(fast.index == 4);
  CHECK(fast.value == 3 * slew);
  CHECK(fast.limit == 2 * slew);
  // 65535 frames at full speed is more than 16 bits.
  CHECK(line_verdict(limits, from, to, 65535, 0).ok());
}

TEST_CASE("limits beyond the compiled-in bounds, or upside down, are refused") {
  Limits limits = default_limits();
  const auto refused = [&](void (*change)(protocol::SetLimits&)) {
    protocol::SetLimits wanted = kDefaultLimits;
    change(wanted);
    Verdict verdict;
    limits.set(wanted, verdict);
    const Refusal reason = verdict.reason;
    CHECK(limits.in_force().slew_ticks == kDefaultLimits.slew_ticks);
    return reason;
  };
  using L = protocol::SetLimits;
  CHECK(refused([](L& l) { l.pulse_min_ticks[2] = 999; }) == Refusal::kOutOfLimits);
  CHECK(refused([](L& l) { l.pulse_max_ticks[2] = 5001; }) == Refusal::kOutOfLimits);
  CHECK(refused([](L& l) { l.pulse_max_ticks[0] = l.pulse_min_ticks[0] - 1; }) ==
        Refusal::kOutOfLimits);
  CHECK(refused([](L& l) { l.pair_sum_min_ticks[1] = l.pair_sum_max_ticks[1] + 1; }) ==
        Refusal::kPairLimit);
  CHECK(refused([](L& l) {
          l.pair_difference_min_ticks[0] = l.pair_difference_max_ticks[0] + 1;
        }) == Refusal::kPairLimit);
  CHECK(refused([](L& l) { l.slew_ticks = 0; }) == Refusal::kBadField);
  CHECK(refused([](L&) {}) == Refusal::kNone);
}

TEST_CASE("what leaves for the servos is inside the range and the slew, whatever was planned") {
  const Limits limits = default_limits();
  const Pulses before = pulses_of(1700, 1700, 4000, 1700);
  Pulses wanted = pulses_of(0, 65535, 65535, 1710);
  limits.confine(before, wanted);
  CHECK(wanted.ticks[0] == kDefaultLimits.pulse_min_ticks[0]);
  CHECK(wanted.ticks[1] == 1700 + kDefaultLimits.slew_ticks);
  CHECK(wanted.ticks[2] == kDefaultLimits.pulse_max_ticks[2]);
  CHECK(wanted.ticks[3] == 1710);
}
