#include "contact/detector.h"

namespace setae {

using protocol::Guard;

namespace {

// Both signs count: a bristle that is pulled lowers the pressure.
uint32_t change(int32_t raw, int32_t from_raw) {
  return static_cast<uint32_t>(raw < from_raw ? from_raw - raw : raw - from_raw);
}

}  // namespace

void Detector::guard_move(uint32_t threshold_raw, uint8_t consecutive, uint16_t deadline_frames) {
  threshold_raw_ = threshold_raw;
  consecutive_ = consecutive;
  deadline_frames_ = deadline_frames;
  tare_again();
}

void Detector::coarse_on(uint32_t threshold_raw) {
  coarse_raw_ = threshold_raw;
  coarse_limit_raw_ = threshold_raw;
  crossed_ = 0;
  if (!rest_.known())
    return;
  const uint32_t now = change(last_raw_, rest_.raw());
  if (now >= threshold_raw)
    coarse_limit_raw_ += now;
}

Finding Detector::take(int32_t raw, RestLevel::Follow follow) {
  last_raw_ = raw;
  rest_.take(raw, follow);
  switch (guard_) {
    case Guard::kTaring:
      return take_tare(raw);
    case Guard::kArmed:
      return take_armed(raw);
    default:
      return take_coarse(raw);
  }
}

Finding Detector::take_tare(int32_t raw) {
  if (tare_samples_ == 0) {
    sum_raw_ = 0;
    lowest_raw_ = raw;
    highest_raw_ = raw;
  }
  sum_raw_ += raw;
  if (raw < lowest_raw_)
    lowest_raw_ = raw;
  if (raw > highest_raw_)
    highest_raw_ = raw;
  if (++tare_samples_ < protocol::kTareSamples)
    return Finding::kNothing;

  guard_ = Guard::kOff;
  tare_samples_ = 0;
  tare_figure_raw_ = change(highest_raw_, lowest_raw_);
  tare_limit_raw_ = threshold_raw_ / kNoisePart;
  if (tare_figure_raw_ > tare_limit_raw_)
    return Finding::kTareNoisy;

  baseline_raw_ = sum_raw_ / protocol::kTareSamples;
  tare_figure_raw_ = change(baseline_raw_, rest_.raw());
  tare_limit_raw_ = threshold_raw_;
  if (tare_figure_raw_ >= tare_limit_raw_)
    return Finding::kTareFar;

  guard_ = Guard::kArmed;
  crossed_ = 0;
  return Finding::kArmed;
}

Finding Detector::take_armed(int32_t raw) {
  if (change(raw, baseline_raw_) < threshold_raw_) {
    crossed_ = 0;
    return Finding::kNothing;
  }
  return ++crossed_ >= consecutive_ ? Finding::kContact : Finding::kNothing;
}

Finding Detector::take_coarse(int32_t raw) {
  if (coarse_raw_ == 0)
    return Finding::kNothing;
  const uint32_t now = change(raw, rest_.raw());
  if (now < coarse_raw_)
    coarse_limit_raw_ = coarse_raw_;  // it has moved away
  if (now < coarse_limit_raw_) {
    crossed_ = 0;
    return Finding::kNothing;
  }
  return ++crossed_ >= kCoarseConsecutive ? Finding::kCoarseContact : Finding::kNothing;
}

bool Detector::deadline_passed() {
  if (guard_ != Guard::kArmed)
    return false;
  if (deadline_frames_ != 0)
    --deadline_frames_;
  return deadline_frames_ == 0;
}

}  // namespace setae
