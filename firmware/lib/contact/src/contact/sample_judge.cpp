#include "contact/sample_judge.h"

namespace setae {

using protocol::Sensor;

namespace {

// LPS33HW, datasheet table 3: operating pressure range.
constexpr int32_t kPressureMinRaw = 260L * protocol::kPressureLsbPerHpa;
constexpr int32_t kPressureMaxRaw = 1260L * protocol::kPressureLsbPerHpa;
// From sample to sample. A contact jumps once, and a bristle that swings takes some samples to
// turn round.
constexpr int32_t kJumpRaw = 5L * protocol::kPressureLsbPerHpa;
constexpr uint8_t kTurn = 4;
constexpr uint8_t kNoisyTurns = 6 * kTurn;

}  // namespace

Sensor SampleJudge::take(int32_t raw) {
  const int32_t step = raw - last_raw_;
  last_raw_ = raw;
  if (step != 0) {
    same_ = 0;
  } else if (same_ < protocol::kSensorStuckSamples) {
    ++same_;
  }

  const int8_t jump = step > kJumpRaw ? 1 : step < -kJumpRaw ? -1 : 0;
  const bool turned = jump != 0 && jump == -jump_;
  jump_ = jump;
  if (turned) {
    if (turns_ < kNoisyTurns)
      turns_ += kTurn;
  } else if (turns_ != 0) {
    --turns_;
  }
  if (turns_ >= kNoisyTurns)
    noisy_ = true;
  if (turns_ == 0)
    noisy_ = false;

  if (raw < kPressureMinRaw || raw > kPressureMaxRaw)
    return Sensor::kRange;
  if (same_ + 1 >= protocol::kSensorStuckSamples)
    return Sensor::kStuck;
  return noisy_ ? Sensor::kNoisy : Sensor::kOk;
}

}  // namespace setae
