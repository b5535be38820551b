#include "hal_uno/uno_hal.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "hal_uno/retained_memory.h"
#include "hal_uno/servo_pulses.h"
#include "hal_uno/uart.h"

namespace setae {
namespace {

// After 0.25 s without service() the watchdog interrupts, after as much again it resets: the
// interrupt says why, and lets the pulses end where a reset would cut one short.
void start_watchdog() {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDE) | _BV(WDP2);
  }
}

}  // namespace

void UnoHal::begin() {
  retained_memory::begin();
  uart::begin();
  servo_pulses::begin();
  sensor_.begin();
  start_watchdog();
}

void UnoHal::service() {
  if (retained_memory::stall_marked()) {  // it was slow, but it did turn
    retained_memory::clear_stall();
    start_watchdog();
  }
  wdt_reset();
}

BoardTime UnoHal::now() {
  return servo_pulses::now();
}

ReceiveRing& UnoHal::received() {
  return uart::received();
}

TransmitRing& UnoHal::to_send() {
  return uart::to_send();
}

void UnoHal::start_sending() {
  uart::start_sending();
}

LineErrors UnoHal::line_errors() {
  return uart::errors();
}

uint32_t UnoHal::set_pulses(const Pulses& pulses, uint8_t attached) {
  const uint32_t frame = servo_pulses::set(pulses, attached);
  retained_memory::seal();  // once a frame, after the board wrote it
  return frame;
}

SensorReading UnoHal::read_sensor() {
  return sensor_.poll(servo_pulses::now());
}

protocol::ResetCause UnoHal::reset_cause() {
  return retained_memory::reset_cause();
}

Retained& UnoHal::retained() {
  return retained_memory::content();
}

}  // namespace setae

ISR(WDT_vect) {
  setae::retained_memory::mark_stall_from_interrupt();
  setae::servo_pulses::detach_from_interrupt();
}
