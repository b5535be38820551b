// Constant tables stay in flash on an AVR, where plain `const` would copy them to RAM.
#pragma once

#include <stdint.h>
#include <string.h>

#ifdef __AVR__
#include <avr/pgmspace.h>
#define SETAE_FLASH PROGMEM
#else
#define SETAE_FLASH
#endif

// For what runs once a byte: the compiler, told to save flash, would make a call of it.
#define SETAE_HOT inline __attribute__((always_inline))

namespace setae {
namespace protocol {

SETAE_HOT uint8_t next_byte(const uint8_t*& from) {
#ifdef __AVR__
  uint8_t byte;
  // The last operand: what was stored there must be, before.
  asm volatile("ld %0, %a1+" : "=r"(byte), "+x"(from) : "m"(*from));
  return byte;
#else
  return *from++;
#endif
}

inline uint8_t flash_read(const uint8_t* address) {
#ifdef __AVR__
  return pgm_read_byte(address);
#else
  return *address;
#endif
}

inline uint32_t flash_read(const uint32_t* address) {
#ifdef __AVR__
  return pgm_read_dword(address);
#else
  return *address;
#endif
}

template <typename T>
void flash_copy(const T* address, T& out) {
#ifdef __AVR__
  memcpy_P(&out, address, sizeof(T));
#else
  memcpy(&out, address, sizeof(T));
#endif
}

}  // namespace protocol
}  // namespace setae
