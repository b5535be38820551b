// Plays the queued segments, one step a servo frame.
//
// Where the queue runs dry the pulses stay at the last segment's end, which lies on the path
// that the host planned: playback never overshoots and never jumps.
#pragma once

#include <stdint.h>

#include "hal/hal.h"
#include "motion/line.h"
#include "motion/segment_queue.h"

namespace setae {

class Player {
 public:
  // The playing segment counts until its end is put out.
  uint8_t queued() const { return queue_.size(); }
  uint8_t room() const { return queue_.room(); }
  bool empty() const { return queue_.empty(); }

  // Where the last queued segment ends; only while not empty.
  const uint16_t* end_ticks() const { return queue_.back().target_ticks; }

  void push(const protocol::Segment& segment) { queue_.push(segment); }
  void clear();

  // At a frame's start: from the pulses put out now to those of the next frame. False, and the
  // pulses as they were, once the last segment's end is out.
  bool step(Pulses& pulses);

 private:
  SegmentQueue queue_;
  Line line_;
  bool playing_ = false;  // the front segment has begun
};

}  // namespace setae
