// The stop switch, normally closed, from D4 to ground. A broken wire is an open switch.
#pragma once

#include <avr/io.h>

namespace setae {
namespace stop_switch {

inline void begin() {
  PORTD |= _BV(PORTD4);  // pull-up
}

inline bool open() {
  return (PIND & _BV(PIND4)) != 0;
}

}  // namespace stop_switch
}  // namespace setae
