// The serial line to the host. Both directions run on interrupts through rings of their own.
#pragma once

#include <stdint.h>

namespace setae {
namespace uart {

void begin();
bool read(uint8_t& byte);
uint8_t write_room();
void write(const uint8_t* data, uint8_t size);

}  // namespace uart
}  // namespace setae
