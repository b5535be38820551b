// First in, first out: the segments that the host sent ahead.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

class SegmentQueue {
 public:
  uint8_t size() const { return size_; }
  uint8_t room() const { return protocol::kSegmentQueueSlots - size_; }
  bool empty() const { return size_ == 0; }

  const protocol::Segment& front() const { return slots_[front_]; }
  const protocol::Segment& back() const { return slots_[slot(size_ - 1)]; }

  // Needs room.
  void push(const protocol::Segment& segment) {
    slots_[slot(size_)] = segment;
    ++size_;
  }
  // Needs not be empty.
  void pop() {
    front_ = slot(1);
    --size_;
  }
  void clear() { size_ = 0; }

 private:
  uint8_t slot(uint8_t offset) const {
    const uint8_t at = front_ + offset;
    return at < protocol::kSegmentQueueSlots ? at : at - protocol::kSegmentQueueSlots;
  }

  protocol::Segment slots_[protocol::kSegmentQueueSlots] = {};
  uint8_t front_ = 0;
  uint8_t size_ = 0;
};

}  // namespace setae
