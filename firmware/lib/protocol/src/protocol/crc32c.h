// CRC-32C (Castagnoli), reflected polynomial 0x82F63B78; "123456789" gives 0xE3069283.
#pragma once

#include <stdint.h>

namespace setae {
namespace protocol {

class Crc32c {
 public:
  void add(uint8_t byte);
  void add(const uint8_t* data, uint8_t size);

  uint32_t value() const { return ~register_; }

  // After data and its own CRC, little-endian, the register holds a constant. So a receiver
  // needs not know where the data end.
  bool matched() const { return register_ == kResidue; }

 private:
  static constexpr uint32_t kResidue = 0xB798B438;

  uint32_t register_ = 0xFFFFFFFF;
};

inline uint32_t crc32c(const uint8_t* data, uint8_t size) {
  Crc32c crc;
  crc.add(data, size);
  return crc.value();
}

}  // namespace protocol
}  // namespace setae
