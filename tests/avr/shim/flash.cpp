#include "flash.h"

#include <string.h>

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kSpmcsr = 0x57;
constexpr uint8_t kSectionBusy = 1 << 6;
constexpr uint8_t kReadEnable = 1 << 4;
constexpr uint8_t kLockBits = 1 << 3;
constexpr uint8_t kPageWrite = 1 << 2;
constexpr uint8_t kPageErase = 1 << 1;
constexpr uint8_t kEnable = 1 << 0;
constexpr uint8_t kSignature = 1 << 5;
constexpr uint8_t kCommand =
    kSignature | kReadEnable | kLockBits | kPageWrite | kPageErase | kEnable;

constexpr uint16_t kR0 = 0, kR1 = 1, kZLow = 30, kZHigh = 31;
// Behind this the processor waits for a write's end; before it, it goes on.
constexpr uint16_t kNoReadWhileWrite = 0x7000;
constexpr uint16_t kFlashBytes = 0x8000;
constexpr Cycle kWindowCycles = 4;
// Section 27.8: 3.7 to 4.5 ms for a page, either way.
constexpr Cycle kPageCycles = 72000;

}  // namespace

Flash::Flash(Chip& chip)
    : chip_(chip), alarm_(chip, [this](Cycle) {
        busy_ = false;
        set(chip_.get(kSpmcsr) & kSectionBusy);
      }) {
  clear_buffer();
  chip_.on_write(kSpmcsr, [this](uint8_t value) { write_control(value); });
  chip_.on_read(kSpmcsr, [this] {
    // SPMEN and its companions fall when no SPM comes in time.
    if (!busy_ && chip_.cycle() > open_until_)
      set(chip_.get(kSpmcsr) & kSectionBusy);
    return chip_.get(kSpmcsr);
  });
}

void Flash::set(uint8_t flags) {
  chip_.set(kSpmcsr, flags);
}

void Flash::clear_buffer() {
  memset(buffer_, 0xFF, sizeof(buffer_));
  memset(filled_, 0, sizeof(filled_));
}

void Flash::reset() {
  alarm_.cancel();
  busy_ = false;
  open_until_ = 0;
  set(0);
  clear_buffer();
}

void Flash::write_control(uint8_t value) {
  if (busy_)
    return;
  const uint8_t section = chip_.get(kSpmcsr) & kSectionBusy;
  set(static_cast<uint8_t>((value & kCommand) | section));
  open_until_ = value & kEnable ? chip_.cycle() + kWindowCycles : 0;
}

void Flash::store_program_memory() {
  const uint8_t command = chip_.get(kSpmcsr) & kCommand;
  if (busy_ || chip_.cycle() > open_until_ || chip_.avr()->pc < kBootStart)
    return;
  open_until_ = 0;
  const uint16_t z = static_cast<uint16_t>(chip_.get(kZLow) | chip_.get(kZHigh) << 8);
  if (command == kEnable) {
    const int word = z % kPageBytes / 2;
    if (!filled_[word]) {  // a word of the buffer can be filled once
      filled_[word] = true;
      buffer_[2 * word] = chip_.get(kR0);
      buffer_[2 * word + 1] = chip_.get(kR1);
    }
    set(chip_.get(kSpmcsr) & kSectionBusy);
  } else if (command == (kEnable | kPageErase) || command == (kEnable | kPageWrite)) {
    begin(static_cast<uint16_t>(z % kFlashBytes & ~(kPageBytes - 1)), (command & kPageErase) != 0);
  } else if (command == (kEnable | kReadEnable)) {
    clear_buffer();
    set(0);
  }
}

void Flash::begin(uint16_t address, bool erases) {
  uint8_t* const page = chip_.avr()->flash + address;
  for (int i = 0; i < kPageBytes; ++i)
    page[i] = erases ? 0xFF : page[i] & buffer_[i];  // to write can only clear bits
  if (!erases)
    clear_buffer();
  ++writes_;
  if (address >= kNoReadWhileWrite) {
    chip_.avr()->cycle += kPageCycles;
    set(chip_.get(kSpmcsr) & kSectionBusy);
    return;
  }
  busy_ = true;
  set(chip_.get(kSpmcsr) | kSectionBusy);
  alarm_.set(chip_.cycle() + kPageCycles);
}

}  // namespace uno
}  // namespace setae
