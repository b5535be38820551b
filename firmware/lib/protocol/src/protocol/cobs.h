// Consistent overhead byte stuffing (Cheshire and Baker 1999) for frames of fewer than 254
// bytes, which it makes exactly one byte longer: a code byte leads each run of bytes that are
// not zero and says where the next zero would be. So a zero on the wire only ever ends a frame.
#pragma once

#include <stdint.h>

#include "protocol/flash.h"

namespace setae {
namespace protocol {

// Stuffs one byte at a time into a sink, which has
//   void stage(uint8_t index, uint8_t byte)   in any order
//   void publish(uint8_t end)                 all before this index are final
class CobsEncoder {
 public:
  // The sink's index of the first byte; indices wrap at 256.
  explicit CobsEncoder(uint8_t first = 0) : at_(static_cast<uint8_t>(first + 1)), code_at_(first) {}

  template <typename Sink>
  SETAE_HOT void push(uint8_t byte, Sink& sink) {
    if (byte != 0) {
      sink.stage(at_, byte);
    } else {
      end_run(sink);
    }
    ++at_;
  }

  // Returns the index after the last byte.
  template <typename Sink>
  uint8_t finish(Sink& sink) {
    end_run(sink);
    return at_;
  }

 private:
  template <typename Sink>
  SETAE_HOT void end_run(Sink& sink) {
    sink.stage(code_at_, static_cast<uint8_t>(at_ - code_at_));
    sink.publish(at_);
    code_at_ = at_;
  }

  uint8_t at_;
  uint8_t code_at_;
};

// Into plain memory.
class MemorySink {
 public:
  explicit MemorySink(uint8_t* wire) : wire_(wire) {}
  void stage(uint8_t index, uint8_t byte) { wire_[index] = byte; }
  void publish(uint8_t) {}

 private:
  uint8_t* wire_;
};

// `wire` takes size + 1 bytes; the delimiter is not among them. size <= 253. In place where
// data is wire + 1.
void cobs_encode(const uint8_t* data, uint8_t size, uint8_t* wire);

// Unstuffs one byte at a time.
class CobsDecoder {
 public:
  enum class Step : uint8_t {
    kNothing,  // a code byte that stands for no data
    kByte,     // `out` is the next byte of the frame
  };

  // `wire` is not the delimiter.
  SETAE_HOT Step push(uint8_t wire, uint8_t& out) {
    if (left_ != 0) {
      --left_;
      out = wire;
      return Step::kByte;
    }
    left_ = static_cast<uint8_t>(wire - 1);
    const bool first = !begun_;
    begun_ = true;
    if (first)
      return Step::kNothing;
    out = 0;  // each code byte but the first stands where a zero was
    return Step::kByte;
  }

  // So many bytes now come as they are. For who takes some of them without push():
  uint8_t left() const { return left_; }
  void skip(uint8_t count) { left_ = static_cast<uint8_t>(left_ - count); }

  // Whether the frame may end here: its last run is complete.
  bool complete() const { return left_ == 0; }
  // No byte since the start.
  bool empty() const { return !begun_; }
  void restart() {
    left_ = 0;
    begun_ = false;
  }

 private:
  uint8_t left_ = 0;  // bytes left in the run
  bool begun_ = false;
};

}  // namespace protocol
}  // namespace setae
