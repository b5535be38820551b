#include "protocol/crc32c.h"

namespace setae {
namespace protocol {
namespace {

constexpr uint32_t kPolynomial = 0x82F63B78;

constexpr Crc32cTable make_table() {
  Crc32cTable table = {};
  for (uint16_t i = 0; i < 256; ++i) {
    uint32_t crc = i;
    for (uint8_t bit = 0; bit < 8; ++bit)
      crc = (crc >> 1) ^ ((crc & 1) ? kPolynomial : 0);
    for (uint8_t page = 0; page < 4; ++page)
      table.pages[page][i] = static_cast<uint8_t>(crc >> (8 * page));
  }
  return table;
}

}  // namespace

// One look-up a byte: 1 KB of flash buys four times the speed of a nibble table's 64 bytes.
extern constexpr Crc32cTable kCrc32cTable SETAE_FLASH = make_table();

uint32_t crc32c(const uint8_t* data, uint8_t size) {
  Crc32c crc;
  for (uint8_t i = 0; i < size; ++i)
    crc.add(data[i]);
  return crc.value();
}

}  // namespace protocol
}  // namespace setae
