// A fuzzer's input, read as small numbers. After its end everything is 0.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace setae {
namespace fuzz {

class Input {
 public:
  Input(const uint8_t* data, size_t size) : next_(data), end_(data + size) {}

  bool more() const { return next_ != end_; }
  uint8_t byte() { return more() ? *next_++ : 0; }
  uint16_t word() {
    const uint8_t low = byte();
    return static_cast<uint16_t>(low | byte() << 8);
  }

 private:
  const uint8_t* next_;
  const uint8_t* end_;
};

}  // namespace fuzz
}  // namespace setae
