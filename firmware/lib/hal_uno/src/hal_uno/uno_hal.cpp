#include "hal_uno/uno_hal.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "hal/hal.h"
#include "hal_uno/eeprom.h"
#include "hal_uno/lps33hw.h"
#include "hal_uno/retained_memory.h"
#include "hal_uno/servo_pulses.h"
#include "hal_uno/stop_switch.h"
#include "hal_uno/supply.h"
#include "hal_uno/uart.h"

namespace setae {
namespace {

Lps33hw sensor;

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

void uno::begin() {
  retained_memory::begin();
  eeprom::begin();
  supply::begin();
  stop_switch::begin();
  uart::begin();
  servo_pulses::begin();
  sensor.begin();
  start_watchdog();
}

void uno::service() {
  if (retained_memory::stall_marked()) {  // it was slow, but it did turn
    retained_memory::clear_stall();
    start_watchdog();
  }
  wdt_reset();
}

BoardTime Hal::now() {
  return servo_pulses::now();
}

uint32_t Hal::frame() {
  return servo_pulses::frame_number();
}

bool Hal::frame_ends_within(uint16_t us) {
  return servo_pulses::frame_ends_within(us);
}

ReceiveRing& Hal::received() {
  return uart::received();
}

TransmitRing& Hal::to_send() {
  return uart::to_send();
}

bool Hal::sending() {
  return uart::to_send().size() > kTransmitRingBytes / 4;
}

void Hal::start_sending() {
  uart::start_sending();
}

LineErrors Hal::line_errors() {
  return uart::errors();
}

uint32_t Hal::set_pulses(const Pulses& pulses, uint8_t attached) {
  return servo_pulses::set(pulses, attached);
}

SensorReading Hal::read_sensor() {
  return sensor.poll();
}

bool Hal::sample_on_its_way() {
  return sensor.fetching();
}

protocol::ResetCause Hal::reset_cause() {
  return retained_memory::reset_cause();
}

Retained& Hal::retained() {
  return retained_memory::content();
}

uint8_t Hal::late_pulses() {
  return servo_pulses::late_armings();
}

uint16_t Hal::bandgap_part() {
  return supply::bandgap_part();
}

bool Hal::stop_switch_open() {
  return stop_switch::open();
}

bool Hal::eeprom_ready() {
  return eeprom::ready();
}

uint8_t Hal::eeprom_read(uint16_t address) {
  return eeprom::read(address);
}

void Hal::eeprom_write(uint16_t address, uint8_t value) {
  eeprom::write(address, value);
}

}  // namespace setae

ISR(WDT_vect) {
  setae::retained_memory::mark_stall_from_interrupt();
  setae::servo_pulses::detach_from_interrupt();
}
