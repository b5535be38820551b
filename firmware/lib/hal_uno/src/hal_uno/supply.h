// The bandgap, measured against the supply.
#pragma once

#include <avr/io.h>
#include <stdint.h>

namespace setae {
namespace supply {

// Conversions run by themselves, one in 0.1 ms: nobody waits, and the bandgap has time to settle.
inline void begin() {
  ADMUX = _BV(REFS0) | _BV(MUX3) | _BV(MUX2) | _BV(MUX1);
  ADCSRB = 0;
  ADCSRA = _BV(ADEN) | _BV(ADSC) | _BV(ADATE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
}

// 0 before the first conversion.
inline uint16_t bandgap_part() {
  return ADC;
}

}  // namespace supply
}  // namespace setae
