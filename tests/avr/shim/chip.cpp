#include "chip.h"

extern "C" {
#include <sim_elf.h>
#include <sim_regbit.h>
}

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <stdexcept>
#include <utility>

namespace setae {
namespace uno {
namespace {

constexpr uint32_t kClockHz = 16000000;

uint8_t call_read(avr_t*, avr_io_addr_t, void* action) {
  return (*static_cast<Chip::OnRead*>(action))();
}

void call_write(avr_t*, avr_io_addr_t, uint8_t value, void* action) {
  (*static_cast<Chip::OnWrite*>(action))(value);
}

// simavr's own prints each section that it loads.
void log_errors(avr_t*, const int level, const char* format, va_list arguments) {
  if (level <= LOG_ERROR)
    vfprintf(stderr, format, arguments);
}

// simavr's own sleeps in real time.
void sleep_virtually(avr_t*, avr_cycle_count_t) {}

}  // namespace

Chip::Chip(const std::string& elf_path) : avr_(avr_make_mcu_by_name("atmega328p")) {
  avr_global_logger_set(log_errors);
  elf_firmware_t firmware;
  memset(&firmware, 0, sizeof(firmware));
  if (elf_read_firmware(elf_path.c_str(), &firmware) != 0)
    throw std::runtime_error("can't read " + elf_path);
  avr_init(avr_);
  avr_->log = LOG_ERROR;
  firmware.frequency = kClockHz;
  firmware.vcc = firmware.avcc = 5000;  // mV; the ADC's reference
  avr_load_firmware(avr_, &firmware);
  avr_->frequency = kClockHz;
  avr_->codeend = avr_->flashend;
  avr_->sleep = sleep_virtually;
  for (avr_io_t* io = avr_->io_port; io != nullptr; io = io->next) {
    const std::string kind = io->kind;
    if (kind == "uart")
      uart_ = reinterpret_cast<avr_uart_t*>(io);
    if (kind == "twi")
      twi_ = reinterpret_cast<avr_twi_t*>(io);
    if (kind == "watchdog")
      watchdog_ = reinterpret_cast<avr_watchdog_t*>(io);
    if (kind == "eeprom")
      eeprom_ = reinterpret_cast<avr_eeprom_t*>(io);
    if (kind == "extint")
      external_ = reinterpret_cast<avr_extint_t*>(io);
    if (kind == "adc")
      adc_ = reinterpret_cast<avr_adc_t*>(io);
    if (kind == "flash")
      io->ioctl = nullptr;  // it would answer SPM, within no time
    if (kind == "timer") {
      avr_timer_t* timer = reinterpret_cast<avr_timer_t*>(io);
      if (timer->name >= '0' && timer->name <= '2')
        timers_[timer->name - '0'] = timer;
    }
  }
  if (uart_ == nullptr || twi_ == nullptr || timers_[0] == nullptr || timers_[1] == nullptr ||
      timers_[2] == nullptr || watchdog_ == nullptr || eeprom_ == nullptr || adc_ == nullptr ||
      external_ == nullptr)
    throw std::runtime_error("this simavr lacks a peripheral of the ATmega328P");
  watchdog_->io.ioctl = nullptr;  // it would answer WDR before the model here sees it
  // Otherwise a low D2 or D3 costs an event each cycle.
  avr_extint_set_strict_lvl_trig(avr_, 0, 0);
  avr_extint_set_strict_lvl_trig(avr_, 1, 0);
}

Chip::~Chip() {
  avr_terminate(avr_);
  free(avr_);
}

void Chip::on_read(uint16_t address, OnRead action) {
  reads_.push_back(std::make_unique<OnRead>(std::move(action)));
  auto& read = avr_->io[AVR_DATA_TO_IO(address)].r;
  read.c = call_read;
  read.param = reads_.back().get();
}

void Chip::on_write(uint16_t address, OnWrite action) {
  writes_.push_back(std::make_unique<OnWrite>(std::move(action)));
  auto& write = avr_->io[AVR_DATA_TO_IO(address)].w;
  write.c = call_write;
  write.param = writes_.back().get();
}

Alarm::Alarm(Chip& chip, std::function<void(Cycle)> action)
    : chip_(chip), action_(std::move(action)) {}

void Alarm::set(Cycle when) {
  due_ = when;
  const Cycle now = chip_.cycle();
  avr_cycle_timer_register(chip_.avr(), when > now ? when - now : 1, ring, this);
}

void Alarm::cancel() {
  avr_cycle_timer_cancel(chip_.avr(), ring, this);
}

avr_cycle_count_t Alarm::ring(avr_t*, avr_cycle_count_t, void* self) {
  Alarm& alarm = *static_cast<Alarm*>(self);
  alarm.action_(alarm.due_);
  return 0;
}

LevelInterrupt::LevelInterrupt(Chip& chip, avr_int_vector_t& vector)
    : chip_(chip), vector_(vector) {
  vector_.raise_sticky = 1;
  avr_irq_register_notify(&vector_.irq[AVR_INT_IRQ_RUNNING], on_running, this);
}

void LevelInterrupt::set(bool on) {
  on_ = on;
  if (on) {
    if (vector_.raised.reg != 0)  // the EEPROM's has no flag
      avr_regbit_set(chip_.avr(), vector_.raised);
    avr_raise_interrupt(chip_.avr(), &vector_);
  } else {
    avr_clear_interrupt(chip_.avr(), &vector_);
    if (vector_.raised.reg != 0)
      avr_regbit_clear(chip_.avr(), vector_.raised);
  }
}

void LevelInterrupt::look_again() {
  if (on_)
    avr_raise_interrupt(chip_.avr(), &vector_);
}

// The handler has returned, and the condition may still be there.
void LevelInterrupt::on_running(avr_irq_t*, uint32_t running, void* self) {
  if (!running)
    static_cast<LevelInterrupt*>(self)->look_again();
}

}  // namespace uno
}  // namespace setae
