// Frames on the wire: COBS(header, payload, CRC-32C little-endian) 0x00.
#pragma once

#include <stdint.h>

#include "protocol/cobs.h"
#include "protocol/crc32c.h"
#include "protocol/messages.h"

namespace setae {
namespace protocol {

// Header and payload together, CRC included.
constexpr uint8_t kFrameBytesMax = kFrameWireBytesMax - kStuffingBytes;
static_assert(kFrameBytesMax <= 253, "cobs_encode knows short frames only");
static_assert(BoardHeader::kSize + kBoardPayloadMax + kCrcBytes <= kFrameBytesMax, "");
static_assert(HostHeader::kSize + kHostPayloadMax + kCrcBytes <= kFrameBytesMax, "");

// Makes a frame of two parts in one pass, CRC and delimiter included: what is published may be on
// the line while the rest is still to come. Returns the sink's index after it.
template <typename Sink>
uint8_t encode_frame(Sink sink, uint8_t first, const uint8_t* part, uint8_t size,
                     const uint8_t* next_part, uint8_t next_size) {
  // Where the first zero is soon found the line need not wait for the bytes before it.
  for (uint8_t run = 0; run < size; ++run) {
    if (part[run] == 0) {
      sink.stage(first, static_cast<uint8_t>(run + 1));
      sink.publish(static_cast<uint8_t>(first + 1));
      break;
    }
  }
  CobsEncoder cobs(first);
  Crc32c crc;
  for (;;) {
    // Two loops and not, as the compiler would have it, one that looks which part is next each
    // time.
    asm volatile("");
    for (; size != 0; --size) {
      const uint8_t byte = next_byte(part);
      crc.add(byte);
      cobs.push(byte, sink);
    }
    if (next_size == 0)
      break;
    part = next_part;
    size = next_size;
    next_size = 0;
  }
  uint32_t value = crc.value();
  for (uint8_t i = 0; i < kCrcBytes; ++i) {
    cobs.push(static_cast<uint8_t>(value), sink);
    value >>= 8;
  }
  const uint8_t delimiter = cobs.finish(sink);
  sink.stage(delimiter, 0);
  const uint8_t end = static_cast<uint8_t>(delimiter + 1);
  sink.publish(end);
  return end;
}

// The `size` bytes of header and payload in `frame` as they go over the wire, delimiter included.
// Returns how many.
uint8_t encode_frame(const uint8_t* frame, uint8_t size, uint8_t* wire);

// Wire bytes in, whole frames with a right CRC out. Whatever else arrives is counted and
// skipped up to the next delimiter.
class FrameDecoder {
 public:
  // Takes bytes until one ends a frame, or all of them; returns how many. `good` tells whether
  // the last one taken ended a good frame, which stays readable until the next call.
  uint8_t take(const uint8_t* wire, uint8_t count, bool& good);

  // The same for one byte.
  bool push(uint8_t wire) {
    bool good;
    take(&wire, 1, good);
    return good;
  }

  // Header and payload of that frame.
  const uint8_t* data() const { return bytes_; }
  uint8_t size() const { return size_ - kCrcBytes; }

  // Of a frame that has begun.
  bool inside() const { return inside_; }
  // Frames lost so far, modulo 256.
  uint8_t damaged() const { return damaged_; }
  // The frame was whole, but means nothing here.
  void count_damaged() { ++damaged_; }

 private:
  bool finish();

  CobsDecoder cobs_;
  Crc32c crc_ = Crc32c::none();
  uint8_t bytes_[kFrameBytesMax] = {};
  uint8_t size_ = 0;
  bool inside_ = false;  // of a frame
  bool too_long_ = false;
  uint8_t damaged_ = 0;
};

}  // namespace protocol
}  // namespace setae
