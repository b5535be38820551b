#include "input.h"

extern "C" {
#include <sim_regbit.h>
}

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kPinD = 0x29;
constexpr uint16_t kDdrD = 0x2A;
constexpr uint16_t kPortD = 0x2B;
constexpr uint16_t kEifr = 0x3C;
constexpr uint16_t kEimsk = 0x3D;
constexpr uint16_t kEicra = 0x69;

constexpr uint8_t kBit = 1 << 2;
constexpr uint8_t kSwitchBit = 1 << 4;
constexpr uint8_t kFlag = 1 << 0;
constexpr uint8_t kSense = 3;
constexpr uint8_t kAnyEdge = 1;
constexpr uint8_t kFalling = 2;
constexpr uint8_t kRising = 3;

}  // namespace

Input::Input(Chip& chip) : chip_(chip), vector_(chip.external().eint[0].vector) {
  chip_.on_read(kPinD, [this] {
    const uint8_t driven = chip_.get(kDdrD), port = chip_.get(kPortD);
    // Open it is pulled up, where the program has asked for that.
    const uint8_t pulled = switch_closed_ ? 0 : kSwitchBit;
    const uint8_t levels = static_cast<uint8_t>(port & (driven | pulled) & ~kBit);
    return static_cast<uint8_t>(levels | (level() ? kBit : 0));
  });
  chip_.on_write(kEicra, [this](uint8_t value) { chip_.set(kEicra, value); });
  chip_.on_write(kEimsk, [this](uint8_t value) {
    chip_.set(kEimsk, value);
    if (avr_regbit_get(chip_.avr(), vector_.raised))
      avr_raise_interrupt(chip_.avr(), &vector_);
  });
  chip_.on_write(kEifr, [this](uint8_t value) {
    if (value & kFlag) {
      avr_clear_interrupt(chip_.avr(), &vector_);
      avr_regbit_clear(chip_.avr(), vector_.raised);
    }
  });
}

void Input::reset() {
  for (const uint16_t address : {kEifr, kEimsk, kEicra})
    chip_.set(address, 0);
  before_ = level();
}

void Input::set_wired(bool wired) {
  wired_ = wired;
  look();
}

void Input::drive(bool level) {
  driven_ = level;
  look();
}

bool Input::level() const {
  if ((chip_.get(kDdrD) & kBit) != 0 || !wired_)
    return (chip_.get(kPortD) & kBit) != 0;
  return driven_;
}

void Input::look() {
  const bool now = level();
  if (now == before_)
    return;
  before_ = now;
  const uint8_t sense = chip_.get(kEicra) & kSense;
  if (sense == kAnyEdge || sense == (now ? kRising : kFalling))
    avr_raise_interrupt(chip_.avr(), &vector_);
}

}  // namespace uno
}  // namespace setae
