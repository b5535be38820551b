// An Arduino UNO that runs an ELF file, in virtual time.
#pragma once

#include <string>
#include <vector>

#include "adc.h"
#include "chip.h"
#include "eeprom.h"
#include "flash.h"
#include "input.h"
#include "lps33hw.h"
#include "pins.h"
#include "twi.h"
#include "usart.h"
#include "usb_chip.h"
#include "watchdog.h"

namespace setae {
namespace uno {

// Of one interrupt's handler, from the entry's first cycle to RETI's last.
struct HandlerTime {
  uint64_t count;
  Cycle total;
  Cycle longest;
};

class Uno {
 public:
  explicit Uno(const std::string& elf_path);
  ~Uno();

  // Pressing the button, or opening the port: RAM stays.
  void press_reset();
  // Takes the power away and gives it back: RAM is lost, the sensor starts anew, and the EEPROM
  // byte that was being written becomes `torn`.
  void cycle_power(uint8_t torn);
  // What the chip is fed with. Below 2.7 V it is held in reset, and starts when it is fed again.
  void set_supply(double volts);
  // Puts bytes into the flash, as a programmer does.
  void load(uint16_t address, const uint8_t* data, size_t size);
  // Where a reset goes to: the fuse BOOTRST and the size of the bootloader.
  void set_start(uint16_t address);
  // From that cycle on the program stands still for a time, as in a section with interrupts off;
  // everything else on the chip goes on.
  void hold_program(Cycle from, Cycle duration);
  // Until that cycle, or until the board has sent a byte of 0: a whole frame.
  void run(Cycle end, bool stop_after_frame);

  UsbChip& usb() { return usb_; }
  Usart& usart() { return usart_; }
  Eeprom& eeprom() { return eeprom_; }
  Adc& adc() { return adc_; }
  Flash& flash() { return flash_; }
  // D2 and D4: the sensor's data-ready pin and the stop switch, where they are wired.
  Input& d2() { return d2_; }
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
  // The next instruction, in bytes, and whether it may be interrupted.
  uint32_t program_counter() const { return chip_.program_counter(); }
  bool interrupts_on() const { return chip_.interrupts_on(); }
  // The program did what no part does: simavr gave up.
  bool crashed() const { return chip_.crashed(); }
  int resets() const { return resets_; }
  // How often the main loop said that it turns, by the instruction WDR.
  uint64_t turns() const { return watchdog_.feeds(); }
  // By the vector's number, from 1 on.
  HandlerTime handler(int vector) const;

 private:
  // simavr's list of peripherals, joined to hear of WDR and SPM.
  struct Listener {
    avr_io_t io;
    Uno* uno;
  };
  struct Vector {
    Uno* uno;
    avr_int_vector_t* vector;
    HandlerTime time;
    Cycle entered;
  };

  static int on_ioctl(avr_io_t* io, uint32_t request, void* parameter);
  static void on_running(avr_irq_t* irq, uint32_t running, void* vector);
  void reset_peripherals();
  // RAM stays, and the flags of earlier resets.
  void restart(uint8_t cause);

  void paint_ram();

  Chip chip_;
  UsbChip usb_;
  Usart usart_;
  Input d2_;
  Lps33hw sensor_;
  Twi twi_;
  Pins pins_;
  Watchdog watchdog_;
  Eeprom eeprom_;
  Adc adc_;
  Flash flash_;
  Listener listener_ = {};
  std::vector<std::unique_ptr<Vector>> vectors_;
  Alarm end_;
  Alarm hold_;
  Cycle hold_cycles_ = 0;
  Cycle run_end_ = 0;
  bool watching_ = false;
  bool was_off_ = false;
  Cycle off_since_ = 0;
  uint32_t off_at_ = 0;
  Cycle longest_off_ = 0;
  uint32_t longest_off_at_ = 0;
  bool bitten_ = false;
  bool held_ = false;  // by the brown-out detector
  int resets_ = 0;
};

}  // namespace uno
}  // namespace setae
