// An Arduino UNO that runs an ELF file, in virtual time.
#pragma once

#include <string>
#include <vector>

#include "chip.h"
#include "lps33hw.h"
#include "pins.h"
#include "twi.h"
#include "usart.h"

namespace setae {
namespace uno {

class Uno {
 public:
  explicit Uno(const std::string& elf_path);
  ~Uno();

  // Pressing the button, or opening the port: RAM stays.
  void press_reset();
  // Until that cycle, or until the board has sent a byte of 0: a whole frame.
  void run(Cycle end, bool stop_after_frame);

  Usart& usart() { return usart_; }
  Lps33hw& sensor() { return sensor_; }
  Twi& twi() { return twi_; }
  Pins& pins() { return pins_; }
  Chip& chip() { return chip_; }

  // Instruction by instruction, slower: the longest time with interrupts off.
  void watch_interrupts(bool on);
  Cycle longest_interrupts_off() const { return longest_off_; }
  // Where in the flash it began: an interrupt's vector, or just after a `cli`.
  uint32_t longest_off_at() const { return longest_off_at_; }
  // Deepest stack since power-on.
  int stack_bytes() const;
  int resets() const { return resets_; }

 private:
  // simavr's list of peripherals, joined to hear of resets: the watchdog's come from inside.
  struct Listener {
    avr_io_t io;
    Uno* uno;
  };
  struct Vector {
    Uno* uno;
    avr_int_vector_t* vector;
  };

  static void on_reset(avr_io_t* io);
  static void on_running(avr_irq_t* irq, uint32_t running, void* vector);
  void reset_peripherals();

  Chip chip_;
  Usart usart_;
  Lps33hw sensor_;
  Twi twi_;
  Pins pins_;
  Listener listener_ = {};
  std::vector<std::unique_ptr<Vector>> vectors_;
  Alarm end_;
  Cycle run_end_ = 0;
  bool watching_ = false;
  bool was_off_ = false;
  Cycle off_since_ = 0;
  uint32_t off_at_ = 0;
  Cycle longest_off_ = 0;
  uint32_t longest_off_at_ = 0;
  uint16_t stack_floor_ = 0;
  int resets_ = 0;
};

}  // namespace uno
}  // namespace setae
