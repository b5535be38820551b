#include "lps33hw.h"

#include <math.h>
#include <string.h>

#include <utility>

namespace setae {
namespace uno {
namespace {

constexpr double kClockHz = 16e6;

constexpr uint8_t kWhoAmI = 0x0F;
constexpr uint8_t kCtrlReg1 = 0x10;
constexpr uint8_t kCtrlReg2 = 0x11;
constexpr uint8_t kCtrlReg3 = 0x12;
constexpr uint8_t kStatus = 0x27;
constexpr uint8_t kPressOutXl = 0x28;
constexpr uint8_t kPressOutH = 0x2A;

constexpr uint8_t kPressureReady = 1 << 0;
constexpr uint8_t kPressureOverrun = 1 << 4;
constexpr uint8_t kBlockDataUpdate = 1 << 1;
constexpr uint8_t kSoftwareReset = 1 << 2;
constexpr uint8_t kAutoIncrement = 1 << 4;
constexpr uint8_t kBoot = 1 << 7;
constexpr uint8_t kActiveLow = 1 << 7;
constexpr uint8_t kDataReady = 1 << 2;

// Section 9, CTRL_REG1: output data rates by bits 6:4.
constexpr double kRatesHz[8] = {0, 1, 10, 25, 50, 75, 0, 0};

bool writable(uint8_t reg) {
  return (reg >= 0x0B && reg <= 0x0D) || (reg >= 0x10 && reg <= 0x12) || reg == 0x14 ||
         (reg >= 0x15 && reg <= 0x19) || reg == 0x1A;
}

}  // namespace

Lps33hw::Lps33hw(Chip& chip, std::function<void(bool)> on_ready)
    : chip_(chip),
      on_ready_(std::move(on_ready)),
      next_sample_(chip, [this](Cycle when) { sample(when); }) {
  clear();
}

void Lps33hw::power_up() {
  clear();
  tell_ready();
}

void Lps33hw::keep_sampling() {
  if (kRatesHz[(registers_[kCtrlReg1] >> 4) & 7] != 0)
    next_sample_.set(static_cast<Cycle>(llround(due_)));
}

Cycle Lps33hw::next_sample() const {
  const bool samples = kRatesHz[(registers_[kCtrlReg1] >> 4) & 7] != 0;
  return samples ? static_cast<Cycle>(llround(due_)) : 0;
}

void Lps33hw::clear() {
  memset(registers_, 0, sizeof(registers_));
  registers_[kCtrlReg2] = kAutoIncrement;
  locked_ = held_back_ = false;
  next_sample_.cancel();
}

// CTRL_REG3: the data-ready signal on the pin, and which level says so.
void Lps33hw::tell_ready() {
  const uint8_t control = registers_[kCtrlReg3];
  const bool ready = (control & kDataReady) && (registers_[kStatus] & kPressureReady);
  on_ready_(ready != ((control & kActiveLow) != 0));
}

bool Lps33hw::addressed(uint8_t address, bool reading) {
  if (!present_ || address != address_)
    return false;
  pointer_next_ = !reading;
  return true;
}

void Lps33hw::write(uint8_t value) {
  if (pointer_next_) {
    pointer_next_ = false;
    pointer_ = value & 0x7F;
    return;
  }
  write_register(pointer_, value);
  if (registers_[kCtrlReg2] & kAutoIncrement)
    pointer_ = (pointer_ + 1) & 0x7F;
}

uint8_t Lps33hw::read() {
  const uint8_t value = read_register(pointer_);
  if (registers_[kCtrlReg2] & kAutoIncrement)
    pointer_ = (pointer_ + 1) & 0x7F;
  return value;
}

void Lps33hw::write_register(uint8_t reg, uint8_t value) {
  if (!writable(reg))
    return;
  if (reg == kCtrlReg2 && (value & (kSoftwareReset | kBoot))) {
    power_up();
    return;
  }
  registers_[reg] = value;
  if (reg == kCtrlReg3)
    tell_ready();
  if (reg == kCtrlReg1) {
    const double rate_hz = kRatesHz[(value >> 4) & 7];
    if (rate_hz == 0) {
      next_sample_.cancel();
    } else {
      due_ = static_cast<double>(chip_.cycle()) + kClockHz / (rate_hz * rate_);
      next_sample_.set(static_cast<Cycle>(llround(due_)));
    }
  }
}

uint8_t Lps33hw::read_register(uint8_t reg) {
  if (reg == kWhoAmI)
    return identity_;
  const uint8_t value = registers_[reg];
  if (reg >= kPressOutXl && reg < kPressOutH)
    locked_ = (registers_[kCtrlReg1] & kBlockDataUpdate) != 0;
  if (reg == kPressOutH) {
    registers_[kStatus] &= static_cast<uint8_t>(~(kPressureReady | kPressureOverrun));
    locked_ = false;
    if (held_back_)
      show(held_raw_);
    held_back_ = false;
    tell_ready();
  }
  return value;
}

void Lps33hw::set_pressure(Cycle from, int32_t raw) {
  pending_.push_back({from, raw});
}

void Lps33hw::sample(Cycle when) {
  const double rate_hz = kRatesHz[(registers_[kCtrlReg1] >> 4) & 7];
  due_ += kClockHz / (rate_hz * rate_);
  next_sample_.set(static_cast<Cycle>(llround(due_)));
  while (!pending_.empty() && pending_.front().ready <= when) {
    raw_ = pending_.front().raw;
    pending_.erase(pending_.begin());
  }
  if (silent_)
    return;
  // The part's noise is many times the last bit, so that no value stays for long.
  const int32_t raw = raw_ == last_raw_ ? raw_ ^ 1 : raw_;
  last_raw_ = raw;
  samples_.push_back({when, raw});
  if (locked_) {  // BDU: not updated until both parts have been read
    held_back_ = true;
    held_raw_ = raw;
  } else {
    show(raw);
  }
}

void Lps33hw::show(int32_t raw) {
  const uint8_t overrun = registers_[kStatus] & kPressureReady ? kPressureOverrun : 0;
  for (int i = 0; i < 3; ++i)
    registers_[kPressOutXl + i] = static_cast<uint8_t>(static_cast<uint32_t>(raw) >> (8 * i));
  registers_[kStatus] = static_cast<uint8_t>(registers_[kStatus] | kPressureReady | overrun);
  tell_ready();
}

}  // namespace uno
}  // namespace setae
