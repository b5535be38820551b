// Decides from pressure samples whether the bristle touches something.
//
// A guarded move first takes a baseline (tare) and then compares each sample with it. Outside
// guarded moves a coarser threshold watches every motion, against the level at rest.
#pragma once

#include <stdint.h>

#include "contact/rest_level.h"
#include "protocol/messages.h"

namespace setae {

enum class Finding : uint8_t {
  kNothing,
  kArmed,      // the baseline is taken
  kTareNoisy,  // the guard is off again
  kTareFar,    // the guard is off again
  kContact,
  kCoarseContact,
};

class Detector {
 public:
  // A change that would be a contact at `threshold_raw` is no baseline, and neither is one that
  // wanders by this part of it.
  static constexpr uint8_t kNoisePart = 4;
  static constexpr uint8_t kCoarseConsecutive = 2;

  protocol::Guard guard() const { return guard_; }
  // What samples are compared with.
  int32_t baseline_raw() const {
    return guard_ == protocol::Guard::kArmed ? baseline_raw_ : rest_.raw();
  }
  int32_t last_raw() const { return last_raw_; }

  // Starts the tare.
  void guard_move(uint32_t threshold_raw, uint8_t consecutive, uint16_t deadline_frames);
  void tare_again() {
    guard_ = protocol::Guard::kTaring;
    tare_samples_ = 0;
  }
  void guard_off() { guard_ = protocol::Guard::kOff; }

  // Motion without a guard begins. From here until coarse_off() samples are held against
  // `threshold_raw` (0: none). A robot that already presses on something may move away: then
  // only a further change by the threshold counts.
  void coarse_on(uint32_t threshold_raw);
  void coarse_off() { coarse_raw_ = 0; }

  Finding take(int32_t raw, RestLevel::Follow follow);

  // At each frame's start. True where the guarded move's deadline has come.
  bool deadline_passed();

  // The last findings of a tare, for the host to read.
  uint32_t tare_figure_raw() const { return tare_figure_raw_; }
  uint32_t tare_limit_raw() const { return tare_limit_raw_; }

 private:
  Finding take_tare(int32_t raw);
  Finding take_armed(int32_t raw);
  Finding take_coarse(int32_t raw);

  protocol::Guard guard_ = protocol::Guard::kOff;
  uint32_t threshold_raw_ = 0;
  uint8_t consecutive_ = 0;
  uint16_t deadline_frames_ = 0;

  RestLevel rest_;
  int32_t last_raw_ = 0;
  int32_t baseline_raw_ = 0;

  int32_t sum_raw_ = 0;  // eight samples of 23 bits
  int32_t lowest_raw_ = 0;
  int32_t highest_raw_ = 0;
  uint8_t tare_samples_ = 0;
  uint32_t tare_figure_raw_ = 0;
  uint32_t tare_limit_raw_ = 0;

  uint32_t coarse_raw_ = 0;
  uint32_t coarse_limit_raw_ = 0;
  uint8_t crossed_ = 0;  // samples in a row
};

}  // namespace setae
