#include "adc.h"

extern "C" {
#include <sim_regbit.h>
}

#include <algorithm>

namespace setae {
namespace uno {
namespace {

constexpr uint16_t kAdcL = 0x78;
constexpr uint16_t kAdcH = 0x79;
constexpr uint16_t kAdcsra = 0x7A;
constexpr uint16_t kAdmux = 0x7C;

constexpr uint8_t kEnable = 1 << 7;
constexpr uint8_t kStart = 1 << 6;
constexpr uint8_t kFlag = 1 << 4;
constexpr uint8_t kLeftAdjust = 1 << 5;
constexpr uint8_t kReference = 3 << 6;
constexpr uint8_t kSupplyIsReference = 1 << 6;
constexpr uint8_t kChannel = 0x0F;
constexpr uint8_t kBandgap = 14;

constexpr unsigned kClocks = 13;
constexpr unsigned kFirstClocks = 25;
// Of a conversion; 13.5 of the first one.
constexpr double kSampleClocks = 1.5;
constexpr double kMost = 1023;
// Table 29-13: 70 us at most.
constexpr Cycle kBandgapStartCycles = 70 * 16;

}  // namespace

Adc::Adc(Chip& chip) : chip_(chip), alarm_(chip, [this](Cycle) { done(); }) {
  chip_.on_write(kAdcsra, [this](uint8_t value) { write_control(value); });
  chip_.on_write(kAdmux, [this](uint8_t value) {
    if ((value & kChannel) != (chip_.get(kAdmux) & kChannel))
      selected_at_ = chip_.cycle();
    chip_.set(kAdmux, value);
  });
  for (const uint16_t result : {kAdcL, kAdcH})
    chip_.on_read(result, [this, result] { return chip_.get(result); });
}

void Adc::reset() {
  alarm_.cancel();
  first_ = true;
  for (const uint16_t address : {kAdcL, kAdcH, kAdcsra, kAdmux})
    chip_.set(address, 0);
}

void Adc::write_control(uint8_t value) {
  const uint8_t before = chip_.get(kAdcsra);
  avr_int_vector_t& vector = chip_.adc().adc;
  uint8_t after = static_cast<uint8_t>((value & ~kFlag) | (before & kFlag) | (before & kStart));
  if (value & kFlag) {  // a one clears it
    avr_clear_interrupt(chip_.avr(), &vector);
    after &= static_cast<uint8_t>(~kFlag);
  }
  if ((value & kEnable) == 0) {
    after &= static_cast<uint8_t>(~kStart);
    alarm_.cancel();
    first_ = true;
  } else if ((value & kStart) && !(before & kStart)) {
    const unsigned divider = 1u << std::max(1, value & 7);
    alarm_.set(chip_.cycle() + divider * (first_ ? kFirstClocks : kClocks));
    first_ = false;
  }
  chip_.set(kAdcsra, after);
  if (after & kFlag)
    avr_raise_interrupt(chip_.avr(), &vector);
}

uint16_t Adc::convert() const {
  const uint8_t mux = chip_.get(kAdmux);
  if ((mux & kChannel) != kBandgap || (mux & kReference) != kSupplyIsReference)
    return 0;  // nothing else is wired
  const double clock = 1u << std::max(1, chip_.get(kAdcsra) & 7);
  const double sampled = static_cast<double>(chip_.cycle()) - clock * (kClocks - kSampleClocks);
  if (sampled < static_cast<double>(selected_at_ + kBandgapStartCycles))
    return 0;  // the bandgap is not up yet: too little is as wrong as too much
  return static_cast<uint16_t>(std::min(kMost, 1024 * bandgap_v_ / supply_v_));
}

void Adc::done() {
  const unsigned result = convert() << (chip_.get(kAdmux) & kLeftAdjust ? 6 : 0);
  chip_.set(kAdcL, static_cast<uint8_t>(result));
  chip_.set(kAdcH, static_cast<uint8_t>(result >> 8));
  chip_.set(kAdcsra, static_cast<uint8_t>(chip_.get(kAdcsra) & ~kStart));
  avr_raise_interrupt(chip_.avr(), &chip_.adc().adc);
}

}  // namespace uno
}  // namespace setae
