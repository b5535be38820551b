#include "line.h"

#include <algorithm>

namespace setae {
namespace sim {

void Line::send(int64_t now_us, const uint8_t* data, size_t size) {
  down_free_us_ = std::max(down_free_us_, now_us + settings_.down_latency_us);
  for (size_t i = 0; i < size; ++i) {
    down_free_us_ += settings_.byte_us;
    down_.push_back({down_free_us_, data[i]});
  }
}

uint8_t Line::take_arrival() {
  const uint8_t byte = down_.front().value;
  down_.pop_front();
  return byte;
}

void Line::transmit(int64_t now_us, uint8_t byte) {
  up_byte_ = byte;
  up_done_us_ = now_us + settings_.byte_us;
}

void Line::finish_transmit() {
  if (settings_.up_flush_us == 0) {
    flush_us_ = up_done_us_;
  } else if (chip_.empty()) {
    flush_us_ = (up_done_us_ / settings_.up_flush_us + 1) * settings_.up_flush_us;
  }
  chip_.push_back(up_byte_);
  up_done_us_ = kNever;
}

void Line::flush() {
  host_.insert(host_.end(), chip_.begin(), chip_.end());
  chip_.clear();
  flush_us_ = kNever;
}

size_t Line::read(uint8_t* data, size_t room) {
  const size_t size = std::min(room, host_.size());
  std::copy_n(host_.begin(), size, data);
  host_.erase(host_.begin(), host_.begin() + static_cast<std::ptrdiff_t>(size));
  return size;
}

}  // namespace sim
}  // namespace setae
