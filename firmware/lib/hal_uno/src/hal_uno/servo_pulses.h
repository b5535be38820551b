// Four servo pulses whose edges the timers' compare units set by themselves: no interrupt, late
// or not, moves an edge. Servos 0 to 3 are on D9, D10, D11, D3.
//
// The frame's start is also the board's clock.
#pragma once

#include <stdint.h>

#include "hal/hal.h"

namespace setae {
namespace servo_pulses {

void begin();

// For the frame after the returned one and those that follow, all four at once.
uint32_t set(const Pulses& pulses, uint8_t attached);
// Lets the pulses end with this frame. For interrupt handlers.
void detach_from_interrupt();

BoardTime now();
uint32_t frame_number();
bool frame_ends_within(uint16_t us);
// Edges that could not be armed in time, since start, modulo 256: none, unless interrupts are off
// for longer than they ever should be.
uint8_t late_armings();
// What now() said when ticks() said that, less than 30 ms ago.
BoardTime at(uint16_t ticks);
// 0.5 us each; wraps after 32 ms.
uint16_t ticks();

}  // namespace servo_pulses
}  // namespace setae
