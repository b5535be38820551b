#include "hal_uno/retained_memory.h"

#include <avr/io.h>
#include <avr/wdt.h>

namespace setae {
namespace retained_memory {
namespace {

constexpr uint16_t kStallMark = 0x5A3C;
constexpr uint32_t kAliveMark = 0xC0A1E5CE;

struct Block {
  Retained retained;
  uint32_t alive;  // the memory kept its content: power was there all the time
  volatile uint16_t stall;
};

// The start-up code leaves this section alone.
Block block __attribute__((section(".noinit")));
uint8_t reset_flags __attribute__((section(".noinit")));

protocol::ResetCause cause = protocol::ResetCause::kUnknown;

}  // namespace

void begin() {
  const bool kept = block.alive == kAliveMark;
  // Bootloaders clear the flags, and after a reset by the pin they use the watchdog to start us. So
  // a stall is known by its mark; by the flag only where it is the only one.
  if (kept && block.stall == kStallMark) {
    cause = protocol::ResetCause::kWatchdog;
  } else if (reset_flags & _BV(PORF)) {
    cause = protocol::ResetCause::kPowerOn;
  } else if (reset_flags & _BV(BORF)) {
    cause = protocol::ResetCause::kBrownOut;
  } else if (reset_flags == _BV(WDRF)) {  // interrupts were off
    cause = protocol::ResetCause::kWatchdog;
  } else if (kept || (reset_flags & _BV(EXTRF))) {
    cause = protocol::ResetCause::kExternal;
  } else {
    cause = protocol::ResetCause::kPowerOn;
  }
  block.alive = kAliveMark;
  block.stall = 0;
}

protocol::ResetCause reset_cause() {
  return cause;
}

Retained& content() {
  return block.retained;
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
