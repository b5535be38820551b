// The HAL of an Arduino UNO: ATmega328P at 16 MHz. What the board asks is answered in uno_hal.cpp.
#pragma once

namespace setae {
namespace uno {

// Starts everything; then interrupts may come.
void begin();
// Once per turn of the loop: tells the watchdog that the loop turns.
void service();

}  // namespace uno
}  // namespace setae
