#include "eeprom.h"

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kEecr = 0x3F;
constexpr uint16_t kEedr = 0x40;
constexpr uint16_t kEearL = 0x41;
constexpr uint16_t kEearH = 0x42;

constexpr uint8_t kReadEnable = 1 << 0;
constexpr uint8_t kWriteEnable = 1 << 1;
constexpr uint8_t kMasterEnable = 1 << 2;
constexpr uint8_t kReadyInterrupt = 1 << 3;
constexpr uint8_t kMode = 3 << 4;
constexpr uint8_t kEraseOnly = 1 << 4;
constexpr uint8_t kWriteOnly = 2 << 4;

constexpr size_t kBytes = 1024;
constexpr uint8_t kErased = 0xFF;
// Section 8.6.3: four cycles for the sequence, and the core halts for four at a read and for two at
// a write. Table 8-1: times.
constexpr Cycle kWindowCycles = 4;
constexpr int kReadHaltCycles = 4;
constexpr int kWriteHaltCycles = 2;
constexpr Cycle kBothCycles = 54400;
constexpr Cycle kOneCycles = 28800;

}  // namespace

Eeprom::Eeprom(Chip& chip)
    : chip_(chip),
      ready_(chip, chip.eeprom().ready),
      alarm_(chip, [this](Cycle) { done(); }),
      cells_(kBytes, kErased) {
  chip_.on_write(kEecr, [this](uint8_t value) { write_control(value); });
  // EEMPE goes by itself.
  chip_.on_read(kEecr, [this] {
    uint8_t value = chip_.get(kEecr);
    if (chip_.cycle() > open_until_)
      value &= static_cast<uint8_t>(~kMasterEnable);
    return value;
  });
  for (const uint16_t plain : {kEedr, kEearL, kEearH}) {
    chip_.on_write(plain, [this, plain](uint8_t value) {
      if (plain == kEedr || !busy())  // the address stays as long as it is needed
        chip_.set(plain, plain == kEearH ? value & 3 : value);
    });
  }
}

bool Eeprom::busy() const {
  return writing_;
}

uint16_t Eeprom::address() const {
  return static_cast<uint16_t>(chip_.get(kEearL) | (chip_.get(kEearH) & 3) << 8);
}

void Eeprom::reset() {
  open_until_ = 0;
  chip_.set(kEecr, writing_ ? kWriteEnable : 0);
  ready_.set(false);
  if (writing_)
    alarm_.set(done_at_);
}

void Eeprom::cut(uint8_t torn) {
  if (writing_)
    cells_[writing_at_] = torn;
  writing_ = false;
  alarm_.cancel();
}

void Eeprom::write_control(uint8_t value) {
  const Cycle now = chip_.cycle();
  const bool armed = now <= open_until_;
  if ((value & kMasterEnable) && !(value & kWriteEnable))
    open_until_ = now + kWindowCycles;
  const uint8_t mode = busy() ? chip_.get(kEecr) & kMode : value & kMode;
  chip_.set(kEecr, static_cast<uint8_t>(mode | (value & (kMasterEnable | kReadyInterrupt)) |
                                        (busy() ? kWriteEnable : 0)));
  if ((value & kWriteEnable) && armed && !busy())
    begin_write();
  if ((value & kReadEnable) && !busy()) {
    chip_.set(kEedr, cells_[address()]);
    chip_.avr()->cycle += kReadHaltCycles;
  }
  ready_.set((value & kReadyInterrupt) && !busy());
}

void Eeprom::begin_write() {
  const uint8_t mode = chip_.get(kEecr) & kMode;
  const uint8_t old = cells_[address()];
  const uint8_t data = chip_.get(kEedr);
  writing_ = true;
  open_until_ = 0;
  writing_at_ = address();
  // To program can only clear bits.
  becomes_ = mode == kEraseOnly ? kErased : mode == kWriteOnly ? (old & data) : data;
  chip_.set(kEecr, static_cast<uint8_t>((chip_.get(kEecr) | kWriteEnable) & ~kMasterEnable));
  done_at_ = chip_.cycle() + (mode == 0 ? kBothCycles : kOneCycles);
  alarm_.set(done_at_);
  chip_.avr()->cycle += kWriteHaltCycles;
}

void Eeprom::done() {
  cells_[writing_at_] = becomes_;
  writing_ = false;
  ++writes_;
  chip_.set(kEecr, static_cast<uint8_t>(chip_.get(kEecr) & ~kWriteEnable));
  ready_.set(chip_.get(kEecr) & kReadyInterrupt);
}

}  // namespace uno
}  // namespace setae
