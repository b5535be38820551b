// The serial line to the host. Both directions run on interrupts through rings of their own.
#pragma once

#include <avr/io.h>
#include <stdint.h>

#include "hal/hal.h"

namespace setae {
namespace uart {

void begin();
ReceiveRing& received();
TransmitRing& to_send();
inline void start_sending() {
  UCSR0B |= _BV(UDRIE0);
}
LineErrors errors();

// When the frame that was read last had come, in servo_pulses::ticks(). False where more has come
// since: then it waited, and nobody knows how long.
bool frame_ended(uint16_t& ticks);

}  // namespace uart
}  // namespace setae
