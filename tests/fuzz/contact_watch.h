// An armed guard sees every contact, no other, and never goes blind.
#pragma once

#include "step.h"

namespace setae {
namespace fuzz {

class ContactWatch {
 public:
  void on_restart() { *this = ContactWatch(); }
  void on_step(const Step& step);

  // Whether the last step's samples alone called for a trip.
  bool touched() const { return touched_; }

 private:
  uint32_t threshold_raw_ = 0;
  uint8_t consecutive_ = 0;
  uint16_t deadline_frames_ = 0;
  uint32_t ticks_ = 0;  // frames that the board has seen begin
  uint32_t armed_tick_ = 0;
  uint32_t sampled_frame_ = 0;
  uint8_t crossed_ = 0;
  bool touched_ = false;
};

}  // namespace fuzz
}  // namespace setae
