// Consistent overhead byte stuffing (Cheshire and Baker 1999) for frames of fewer than 254
// bytes, which it makes exactly one byte longer: a code byte leads each run of bytes that are
// not zero and says where the next zero would be. So a zero on the wire only ever ends a frame.
#pragma once

#include <stdint.h>

namespace setae {
namespace protocol {

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
  Step push(uint8_t wire, uint8_t& out);

  // Whether the frame may end here: its last run is complete.
  bool complete() const { return left_ == 0; }
  // No byte since the start.
  bool empty() const { return empty_; }
  void restart();

 private:
  uint8_t left_ = 0;  // bytes left in the run
  bool empty_ = true;
};

}  // namespace protocol
}  // namespace setae
