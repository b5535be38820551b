// Frames once more, written from protocol/README.md and not from the firmware: a whole frame at a
// time instead of byte by byte, the CRC bit by bit instead of from a table. What the firmware
// makes of a line is held against this.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace setae {
namespace fuzz {

constexpr size_t kWireMax = 64;  // delimiter included
constexpr size_t kInsideMax = 62;

inline uint32_t reference_crc(const uint8_t* data, size_t size) {
  uint32_t crc = 0xFFFFFFFF;
  for (size_t i = 0; i < size; ++i) {
    crc ^= data[i];
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc >> 1) ^ (0x82F63B78 & (0 - (crc & 1)));
  }
  return ~crc;
}

// Header and payload of one frame.
struct Inside {
  uint8_t bytes[kInsideMax];
  uint8_t size;
};

// `data` with its CRC, stuffed, delimiter included; size <= 58. Returns the bytes on the wire.
inline size_t reference_seal(const uint8_t* data, size_t size, uint8_t* wire) {
  uint8_t inside[kInsideMax];
  memcpy(inside, data, size);
  const uint32_t crc = reference_crc(data, size);
  for (int i = 0; i < 4; ++i)
    inside[size++] = static_cast<uint8_t>(crc >> (8 * i));
  size_t out = 0;
  for (size_t start = 0; start <= size;) {
    size_t end = start;
    while (end < size && inside[end] != 0)
      ++end;
    wire[out++] = static_cast<uint8_t>(end - start + 1);
    memcpy(wire + out, inside + start, end - start);
    out += end - start;
    start = end + 1;
  }
  wire[out++] = 0;
  return out;
}

// What stands between two delimiters, unstuffed and without its CRC; false where it is no frame.
inline bool reference_open(const uint8_t* stuffed, size_t size, Inside& inside) {
  uint8_t bytes[kWireMax];
  size_t out = 0;
  for (size_t at = 0; at < size;) {
    const size_t end = at + stuffed[at];
    if (end > size)
      return false;
    if (at != 0)
      bytes[out++] = 0;
    memcpy(bytes + out, stuffed + at + 1, end - at - 1);
    out += end - at - 1;
    at = end;
  }
  if (out <= 4 || out > kInsideMax)
    return false;
  uint32_t told = 0;
  for (int i = 0; i < 4; ++i)
    told |= static_cast<uint32_t>(bytes[out - 4 + i]) << (8 * i);
  if (reference_crc(bytes, out - 4) != told)
    return false;
  inside.size = static_cast<uint8_t>(out - 4);
  memcpy(inside.bytes, bytes, inside.size);
  return true;
}

// A stream of bytes, cut at its delimiters.
class ReferenceDecoder {
 public:
  enum class Found : uint8_t { kNothing, kFrame, kDamage };

  Found push(uint8_t wire) {
    if (wire != 0) {
      if (size_ < kWireMax)
        stuffed_[size_++] = wire;
      return Found::kNothing;
    }
    const size_t size = size_;
    size_ = 0;
    if (size == 0)
      return Found::kNothing;
    return size < kWireMax && reference_open(stuffed_, size, inside_) ? Found::kFrame
                                                                      : Found::kDamage;
  }

  // Takes bytes up to the first that ends a frame, or all of them; returns how many.
  size_t take(const uint8_t* wire, size_t size, Found& found) {
    found = Found::kNothing;
    const void* end = memchr(wire, 0, size);
    const size_t count = end ? static_cast<size_t>(static_cast<const uint8_t*>(end) - wire) : size;
    const size_t room = kWireMax - size_;
    memcpy(stuffed_ + size_, wire, count < room ? count : room);
    size_ += count < room ? count : room;
    if (end == nullptr)
      return count;
    found = push(0);
    return count + 1;
  }

  const Inside& inside() const { return inside_; }

 private:
  uint8_t stuffed_[kWireMax];
  size_t size_ = 0;
  Inside inside_ = {};
};

}  // namespace fuzz
}  // namespace setae
