// A byte queue between one writer and one reader, one of which may be an
// interrupt handler: each index has one owner and is a single byte, so neither
// side needs a critical section.
#pragma once

#include <stdint.h>

namespace setae {

// At 20 us a byte 128 bytes cover 2.5 ms in which the loop does not read.
constexpr uint8_t kReceiveRingBytes = 128;
// The longest frame, behind what is on its way when it is written.
constexpr uint8_t kTransmitRingBytes = 128;

// Open, since a handler in assembler addresses its members. The indices run freely.
template <uint8_t kBytes>
struct ByteRing {
  static_assert((kBytes & (kBytes - 1)) == 0, "the indices wrap at 256");
  static constexpr uint8_t kMask = kBytes - 1;

  bool push(uint8_t byte) {
    if (size() == kBytes)
      return false;
    stage(head, byte);
    publish(static_cast<uint8_t>(head + 1));
    return true;
  }

  bool pop(uint8_t& byte) {
    if (size() == 0)
      return false;
    byte = *front();
    drop(1);
    return true;
  }

  uint8_t size() const { return static_cast<uint8_t>(head - tail); }
  uint8_t room() const { return static_cast<uint8_t>(kBytes - size()); }

  // The reader's: the oldest bytes, as far as they lie in a row.
  const uint8_t* front() const {
    order();
    return &bytes[tail & kMask];
  }
  uint8_t front_size() const {
    const uint8_t to_wrap = static_cast<uint8_t>(kBytes - (tail & kMask));
    const uint8_t waiting = size();
    return waiting < to_wrap ? waiting : to_wrap;
  }
  void drop(uint8_t count) {
    order();
    tail = static_cast<uint8_t>(tail + count);
  }

  // The writer's, where it has room: bytes at indices from the head on, which the reader sees
  // once the head has passed them.
  void stage(uint8_t index, uint8_t byte) { bytes[index & kMask] = byte; }
  void publish(uint8_t new_head) {
    order();
    head = new_head;
  }

  // Only while the other side is idle.
  void clear() { tail = head; }

  volatile uint8_t head = 0;  // owned by the writer
  volatile uint8_t tail = 0;  // owned by the reader
  // The writer of a received ring says that a frame has ended; the reader takes it back.
  volatile bool ended = false;
  uint8_t bytes[kBytes] = {};

 private:
  // The compiler keeps the bytes' reads and writes on their side of the index's.
  static void order() { asm volatile("" ::: "memory"); }
};

using ReceiveRing = ByteRing<kReceiveRingBytes>;
using TransmitRing = ByteRing<kTransmitRingBytes>;

}  // namespace setae
