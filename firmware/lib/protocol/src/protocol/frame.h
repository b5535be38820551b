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

// Appends the CRC to the `size` bytes of header and payload in `frame`, which has room for it,
// and writes the wire bytes, delimiter included. Returns how many. In place where frame is
// wire + 1.
uint8_t encode_frame(uint8_t* frame, uint8_t size, uint8_t* wire);

// Wire bytes in, whole frames with a right CRC out. Whatever else arrives is counted and
// skipped up to the next delimiter.
class FrameDecoder {
 public:
  // True where this byte ended a good frame. It stays readable until the next push().
  bool push(uint8_t wire);

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
