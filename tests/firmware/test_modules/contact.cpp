#include <doctest/doctest.h>

#include <initializer_list>

#include "contact/detector.h"

using namespace setae;
using protocol::Guard;
using Follow = RestLevel::Follow;

namespace {

constexpr int32_t kHpa = protocol::kPressureLsbPerHpa;
constexpr int32_t kRest = 1013 * kHpa;
constexpr uint32_t kThreshold = 15 * kHpa;
constexpr uint32_t kCoarse = 60 * kHpa;

Finding take(Detector& detector, int32_t raw, int samples, Follow follow = Follow::kNot) {
  Finding finding = Finding::kNothing;
  for (int i = 0; i < samples; ++i)
    finding = detector.take(raw, follow);
  return finding;
}

Detector resting() {
  Detector detector;
  take(detector, kRest, 50, Follow::kClosely);
  return detector;
}

Detector armed(uint8_t consecutive = 1, uint16_t deadline_frames = 100) {
  Detector detector = resting();
  detector.guard_move(kThreshold, consecutive, deadline_frames);
  take(detector, kRest, protocol::kTareSamples);
  return detector;
}

}  // namespace

TEST_CASE("the baseline is the mean of the tare's samples") {
  Detector detector = resting();
  detector.guard_move(kThreshold, 1, 100);
  CHECK(detector.guard() == Guard::kTaring);
  for (int i = 0; i < protocol::kTareSamples - 1; ++i) {
    CHECK(detector.take(kRest + (i % 2 ? 100 : 300), Follow::kNot) == Finding::kNothing);
  }
  CHECK(detector.take(kRest + 100, Follow::kNot) == Finding::kArmed);
  CHECK(detector.guard() == Guard::kArmed);
  CHECK(detector.baseline_raw() == kRest + 200);
}

TEST_CASE("an unsteady tare is no baseline") {
  Detector detector = resting();
  detector.guard_move(kThreshold, 1, 100);
  for (int i = 0; i < protocol::kTareSamples - 1; ++i) {
    detector.take(kRest + (i % 2 ? 4 * kHpa : 0), Follow::kNot);
  }
  CHECK(detector.take(kRest, Follow::kNot) == Finding::kTareNoisy);
  CHECK(detector.guard() == Guard::kOff);
  CHECK(detector.tare_figure_raw() == 4 * kHpa);
}

TEST_CASE("a bristle that already presses is not armed, in either direction") {
  for (int32_t off : {15 * kHpa, -15 * kHpa}) {
    Detector detector = resting();
    detector.guard_move(kThreshold, 1, 100);
    CHECK(take(detector, kRest + off, protocol::kTareSamples) == Finding::kTareFar);
    CHECK(detector.guard() == Guard::kOff);
  }
}

TEST_CASE("a change by the threshold is a contact, with either sign; less is none") {
  for (int32_t sign : {1, -1}) {
    Detector detector = armed();
    CHECK(detector.take(kRest + sign * (15 * kHpa - 1), Follow::kNot) == Finding::kNothing);
    CHECK(detector.take(kRest + sign * 15 * kHpa, Follow::kNot) == Finding::kContact);
  }
}

TEST_CASE("samples must cross in a row") {
  Detector detector = armed(3);
  const int32_t touch = kRest + 20 * kHpa;
  CHECK(take(detector, touch, 2) == Finding::kNothing);
  CHECK(take(detector, kRest, 1) == Finding::kNothing);
  CHECK(take(detector, touch, 2) == Finding::kNothing);
  CHECK(take(detector, touch, 1) == Finding::kContact);
}

TEST_CASE("the baseline stays frozen while armed: a slow push is a contact too") {
  Detector detector = armed();
  int32_t raw = kRest;
  Finding finding = Finding::kNothing;
  while (finding == Finding::kNothing && raw < kRest + 30 * kHpa) {
    raw += kHpa / 20;
    finding = detector.take(raw, Follow::kNot);
  }
  CHECK(finding == Finding::kContact);
  CHECK(raw - kRest <= 15 * kHpa + kHpa / 20);
}

TEST_CASE("the deadline counts frames from arming") {
  Detector detector = resting();
  detector.guard_move(kThreshold, 1, 3);
  CHECK_FALSE(detector.deadline_passed());  // still taring
  take(detector, kRest, protocol::kTareSamples);
  CHECK_FALSE(detector.deadline_passed());
  CHECK_FALSE(detector.deadline_passed());
  CHECK(detector.deadline_passed());
}

TEST_CASE("unguarded motion stops at the coarse threshold") {
  Detector detector = resting();
  detector.coarse_on(kCoarse);
  CHECK(take(detector, kRest + 59 * kHpa, 10) == Finding::kNothing);
  CHECK(take(detector, kRest - 61 * kHpa, 1) == Finding::kNothing);  // a single one is a spike
  CHECK(take(detector, kRest - 61 * kHpa, 1) == Finding::kCoarseContact);
}

TEST_CASE("at rest, and with the threshold off, nothing is a coarse contact") {
  Detector detector = resting();
  CHECK(take(detector, kRest + 200 * kHpa, 10) == Finding::kNothing);
  detector.coarse_on(0);
  CHECK(take(detector, kRest + 200 * kHpa, 10) == Finding::kNothing);
}

TEST_CASE("a robot that presses on something may move away, not on") {
  Detector detector = resting();
  take(detector, kRest + 80 * kHpa, 1);
  detector.coarse_on(kCoarse);
  CHECK(take(detector, kRest + 100 * kHpa, 5) == Finding::kNothing);
  CHECK(take(detector, kRest + 140 * kHpa, 2) == Finding::kCoarseContact);

  detector.coarse_on(kCoarse);
  take(detector, kRest + 10 * kHpa, 2);  // it is free again: the usual threshold holds
  CHECK(take(detector, kRest + 61 * kHpa, 2) == Finding::kCoarseContact);
}

TEST_CASE("the rest level follows the weather, not a contact") {
  RestLevel rest;
  rest.take(kRest, Follow::kSlowly);
  for (int i = 0; i < 5000; ++i)
    rest.take(kRest + 2 * kHpa, Follow::kSlowly);
  CHECK(rest.raw() > kRest + 2 * kHpa - kHpa / 20);

  const int32_t before = rest.raw();
  for (int i = 0; i < 5000; ++i)
    rest.take(kRest + 20 * kHpa, Follow::kSlowly);
  CHECK(rest.raw() == before);
  for (int i = 0; i < 5000; ++i)
    rest.take(kRest + 3 * kHpa, Follow::kNot);
  CHECK(rest.raw() == before);
  for (int i = 0; i < 200; ++i)
    rest.take(kRest + 20 * kHpa, Follow::kClosely);
  CHECK(rest.raw() > kRest + 20 * kHpa - kHpa / 20);
}

TEST_CASE("the rest level holds the sensor's whole range") {
  RestLevel rest;
  rest.take(1260 * kHpa, Follow::kClosely);
  CHECK(rest.raw() == 1260 * kHpa);
  for (int i = 0; i < 500; ++i)
    rest.take(260 * kHpa, Follow::kClosely);
  CHECK(rest.raw() < 261 * kHpa);
}
