#include "protocol/cobs.h"

namespace setae {
namespace protocol {

void cobs_encode(const uint8_t* data, uint8_t size, uint8_t* wire) {
  MemorySink sink(wire);
  CobsEncoder cobs;
  for (uint8_t i = 0; i < size; ++i)
    cobs.push(data[i], sink);
  cobs.finish(sink);
}

}  // namespace protocol
}  // namespace setae
