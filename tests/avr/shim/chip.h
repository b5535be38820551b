// simavr's ATmega328P: its core, memory and interrupt controller. The peripherals that the
// firmware uses are this folder's own; see ../README.md for what is exact.
#pragma once

#include <stdint.h>

extern "C" {
#include <avr_adc.h>
#include <avr_eeprom.h>
#include <avr_extint.h>
#include <avr_timer.h>
#include <avr_twi.h>
#include <avr_uart.h>
#include <avr_watchdog.h>
#include <sim_avr.h>
}

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace setae {
namespace uno {

// Core cycles since power-on, 16 MHz.
using Cycle = uint64_t;

class Chip {
 public:
  using OnRead = std::function<uint8_t()>;
  using OnWrite = std::function<void(uint8_t value)>;

  // Throws std::runtime_error where the file can't be read.
  explicit Chip(const std::string& elf_path);
  ~Chip();
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;

  Cycle cycle() const { return avr_->cycle; }
  bool crashed() const { return avr_->state == cpu_Crashed || avr_->state == cpu_Done; }
  uint32_t program_counter() const { return avr_->pc; }
  bool interrupts_on() const { return avr_->sreg[S_I] != 0; }
  // Data space addresses, as in the data sheet's register summary (in parentheses there).
  uint8_t get(uint16_t address) const { return avr_->data[address]; }
  void set(uint16_t address, uint8_t value) { avr_->data[address] = value; }

  // Takes a register away from simavr's own peripheral.
  void on_read(uint16_t address, OnRead action);
  void on_write(uint16_t address, OnWrite action);

  avr_t* avr() { return avr_; }
  avr_uart_t& uart() { return *uart_; }
  avr_twi_t& twi() { return *twi_; }
  avr_watchdog_t& watchdog() { return *watchdog_; }
  avr_eeprom_t& eeprom() { return *eeprom_; }
  avr_adc_t& adc() { return *adc_; }
  avr_extint_t& external() { return *external_; }
  avr_timer_t& timer(int number) { return *timers_[number]; }

 private:
  avr_t* avr_;
  avr_uart_t* uart_ = nullptr;
  avr_twi_t* twi_ = nullptr;
  avr_watchdog_t* watchdog_ = nullptr;
  avr_eeprom_t* eeprom_ = nullptr;
  avr_adc_t* adc_ = nullptr;
  avr_extint_t* external_ = nullptr;
  avr_timer_t* timers_[3] = {};
  std::vector<std::unique_ptr<OnRead>> reads_;
  std::vector<std::unique_ptr<OnWrite>> writes_;
};

// The next thing a peripheral does by itself. The action gets the cycle at which it happens,
// which may be a few before the core's: simavr looks between instructions only.
class Alarm {
 public:
  Alarm(Chip& chip, std::function<void(Cycle when)> action);
  ~Alarm() { cancel(); }
  Alarm(const Alarm&) = delete;
  Alarm& operator=(const Alarm&) = delete;

  void set(Cycle when);
  void cancel();

 private:
  static avr_cycle_count_t ring(avr_t* avr, avr_cycle_count_t when, void* self);

  Chip& chip_;
  std::function<void(Cycle)> action_;
  Cycle due_ = 0;
};

// An interrupt whose flag stands for a condition, and stays as long as that does.
class LevelInterrupt {
 public:
  LevelInterrupt(Chip& chip, avr_int_vector_t& vector);
  void set(bool on);
  // After the enable bit was set.
  void look_again();

 private:
  static void on_running(avr_irq_t* irq, uint32_t running, void* self);

  Chip& chip_;
  avr_int_vector_t& vector_;
  bool on_ = false;
};

}  // namespace uno
}  // namespace setae
