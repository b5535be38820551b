#include "protocol/frame.h"

namespace setae {
namespace protocol {

uint8_t encode_frame(const uint8_t* frame, uint8_t size, uint8_t* wire) {
  return encode_frame(MemorySink(wire), 0, frame, size, nullptr, 0);
}

namespace {

uint8_t smallest(uint8_t a, uint8_t b) {
  return a < b ? a : b;
}

}  // namespace

uint8_t FrameDecoder::take(const uint8_t* wire, uint8_t count, bool& good) {
  good = false;
  if (!inside_) {
    cobs_.restart();
    crc_ = Crc32c();
    size_ = 0;
    too_long_ = false;
    inside_ = true;
  }
  CobsDecoder cobs = cobs_;  // copies that can stay in registers
  Crc32c crc = crc_;
  uint8_t* out = bytes_ + size_;
  uint8_t room = static_cast<uint8_t>(kFrameBytesMax - size_);
  uint8_t left = count;
  while (left != 0) {
    // Most bytes are in the middle of a run: for so many there is nothing but a zero to look for.
    const uint8_t most = smallest(left, smallest(room, cobs.left()));
    uint8_t run = most;
    if (run != 0) {
      do {
        const uint8_t byte = next_byte(wire);
        if (byte == 0) {
          --wire;
          break;
        }
        *out++ = byte;
        crc.add(byte);
      } while (--run != 0);
    }
    const uint8_t moved = static_cast<uint8_t>(most - run);
    cobs.skip(moved);
    room = static_cast<uint8_t>(room - moved);
    left = static_cast<uint8_t>(left - moved);
    if (left == 0)
      break;

    const uint8_t coded = *wire++;
    --left;
    if (coded == 0) {
      inside_ = false;
      break;
    }
    uint8_t byte;
    if (cobs.push(coded, byte) == CobsDecoder::Step::kNothing)
      continue;
    if (room == 0) {
      too_long_ = true;
      continue;
    }
    --room;
    *out++ = byte;
    crc.add(byte);
  }
  cobs_ = cobs;
  crc_ = crc;
  size_ = static_cast<uint8_t>(kFrameBytesMax - room);
  if (!inside_)
    good = finish();
  return static_cast<uint8_t>(count - left);
}

bool FrameDecoder::finish() {
  // Two delimiters in a row: a sender may lead with one to end what noise began.
  if (cobs_.empty())
    return false;
  const bool good = cobs_.complete() && !too_long_ && size_ > kCrcBytes && crc_.matched();
  if (!good)
    ++damaged_;
  return good;
}

}  // namespace protocol
}  // namespace setae
