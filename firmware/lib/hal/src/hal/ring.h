// A byte queue between one writer and one reader, one of which may be an
// interrupt handler: each index has one owner and is a single byte, so neither
// side needs a critical section.
#pragma once

#include <stdint.h>

namespace setae {

// At 40 us a byte 128 bytes cover 5 ms in which the loop does not read.
constexpr uint8_t kReceiveRingBytes = 128;
// Two telemetry frames.
constexpr uint8_t kTransmitRingBytes = 128;

template <uint8_t kBytes>
class ByteRing {
  static_assert((kBytes & (kBytes - 1)) == 0, "the indices wrap at 256");

 public:
  bool push(uint8_t byte) {
    const uint8_t head = head_;
    if (static_cast<uint8_t>(head - tail_) >= kBytes)
      return false;
    bytes_[head & (kBytes - 1)] = byte;
    head_ = static_cast<uint8_t>(head + 1);
    return true;
  }

  bool pop(uint8_t& byte) {
    const uint8_t tail = tail_;
    if (tail == head_)
      return false;
    byte = bytes_[tail & (kBytes - 1)];
    tail_ = static_cast<uint8_t>(tail + 1);
    return true;
  }

  uint8_t size() const { return static_cast<uint8_t>(head_ - tail_); }
  uint8_t room() const { return static_cast<uint8_t>(kBytes - size()); }

  // Only while the other side is idle.
  void clear() { tail_ = head_; }

 private:
  volatile uint8_t head_ = 0;  // owned by the writer
  volatile uint8_t tail_ = 0;  // owned by the reader
  volatile uint8_t bytes_[kBytes] = {};
};

}  // namespace setae
