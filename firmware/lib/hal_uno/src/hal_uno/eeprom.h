// EEPROM, a byte at a time. Interrupts stay on but for the four cycles that start a write.
#pragma once

#include <avr/io.h>
#include <stdint.h>
#include <util/atomic.h>

namespace setae {
namespace eeprom {

inline bool ready() {
  return (EECR & _BV(EEPE)) == 0;
}

// A write that a reset overtook goes on, for 3.4 ms at most (data sheet, section 8.4).
inline void begin() {
  while (!ready()) {
  }
}

inline uint8_t read(uint16_t address) {
  EEAR = address;
  EECR |= _BV(EERE);
  return EEDR;
}

inline void write(uint16_t address, uint8_t value) {
  EEAR = address;
  EEDR = value;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    EECR |= _BV(EEMPE);
    EECR |= _BV(EEPE);
  }
}

}  // namespace eeprom
}  // namespace setae
