#include "hal_uno/retained_memory.h"

#include <avr/io.h>
#include <avr/wdt.h>
#include <string.h>

#include "protocol/crc32c.h"

namespace setae {
namespace retained_memory {
namespace {

constexpr uint16_t kStallMark = 0x5A3C;

struct Block {
  Retained retained;
  volatile uint16_t stall;
  uint32_t crc;
};

// The start-up code leaves this section alone.
Block block __attribute__((section(".noinit")));
uint8_t reset_flags __attribute__((section(".noinit")));

protocol::ResetCause cause = protocol::ResetCause::kUnknown;

uint32_t crc_of_content() {
  uint8_t bytes[sizeof(Retained)];
  memcpy(bytes, &block.retained, sizeof(bytes));
  return protocol::crc32c(bytes, sizeof(bytes));
}

}  // namespace

void begin() {
  const bool valid = block.crc == crc_of_content();
  // A watchdog reset is known by the mark alone: bootloaders use the watchdog to start us.
  if (valid && block.stall == kStallMark) {
    cause = protocol::ResetCause::kWatchdog;
  } else if (reset_flags & _BV(PORF)) {
    cause = protocol::ResetCause::kPowerOn;
  } else if (reset_flags & _BV(BORF)) {
    cause = protocol::ResetCause::kBrownOut;
  } else if (valid || (reset_flags & _BV(EXTRF))) {
    cause = protocol::ResetCause::kExternal;
  }
  if (!valid)
    memset(&block.retained, 0, sizeof(block.retained));
  block.stall = 0;
  seal();
}

protocol::ResetCause reset_cause() {
  return cause;
}

Retained& content() {
  return block.retained;
}

void seal() {
  block.crc = crc_of_content();
}

void mark_stall_from_interrupt() {
  block.stall = kStallMark;
}

void clear_stall() {
  block.stall = 0;
}

bool stall_marked() {
  return block.stall == kStallMark;
}

}  // namespace retained_memory
}  // namespace setae

// Before main(): after a watchdog reset the watchdog runs on, at its shortest.
extern "C" void setae_save_reset_flags(void) __attribute__((naked, used, section(".init3")));
extern "C" void setae_save_reset_flags(void) {
  setae::retained_memory::reset_flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
}
