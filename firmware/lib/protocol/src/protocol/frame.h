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

// Makes a frame in one pass: what is published may be on the line while the rest is still to come.
template <typename Sink>
class FrameEncoder {
 public:
  explicit FrameEncoder(const Sink& sink) : sink_(sink) {}

  void add(const uint8_t* data, uint8_t size) {
    Sink sink = sink_;  // copies that can stay in registers
    CobsEncoder cobs = cobs_;
    Crc32c crc = crc_;
    for (; size != 0; --size) {
      const uint8_t byte = *data++;
      crc.add(byte);
      cobs.push(byte, sink);
    }
    cobs_ = cobs;
    crc_ = crc;
  }

  // CRC and delimiter. Returns the bytes on the wire.
  uint8_t finish() {
    uint32_t crc = crc_.value();
    for (uint8_t i = 0; i < kCrcBytes; ++i) {
      cobs_.push(static_cast<uint8_t>(crc), sink_);
      crc >>= 8;
    }
    const uint8_t size = cobs_.finish(sink_);
    sink_.stage(size, 0);
    sink_.publish(size + 1);
    return size + 1;
  }

 private:
  Sink sink_;
  CobsEncoder cobs_;
  Crc32c crc_;
};

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

  // Frames lost so far, modulo 256.
  uint8_t damaged() const { return damaged_; }
  // The frame was whole, but means nothing here.
  void count_damaged() { ++damaged_; }

 private:
  bool finish();

  CobsDecoder cobs_;
  Crc32c crc_;
  uint8_t bytes_[kFrameBytesMax];
  uint8_t size_ = 0;
  bool ended_ = true;  // the next byte starts a frame
  bool too_long_ = false;
  uint8_t damaged_ = 0;
};

}  // namespace protocol
}  // namespace setae
