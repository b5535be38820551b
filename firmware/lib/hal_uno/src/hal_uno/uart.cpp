#include "hal_uno/uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal/ring.h"
#include "protocol/messages.h"

namespace setae {
namespace uart {
namespace {

constexpr uint16_t kDivisor = F_CPU / 16 / protocol::kBaud - 1;
static_assert(F_CPU == 16UL * protocol::kBaud * (kDivisor + 1UL), "the baud rate is not exact");

ByteRing<kReceiveRingBytes> received;
ByteRing<kTransmitRingBytes> waiting;

}  // namespace

void begin() {
  UBRR0 = kDivisor;
  UCSR0A = 0;
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);  // 8N1
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

bool read(uint8_t& byte) {
  return received.pop(byte);
}

uint8_t write_room() {
  return waiting.room();
}

void write(const uint8_t* data, uint8_t size) {
  for (uint8_t i = 0; i < size; ++i)
    waiting.push(data[i]);
  UCSR0B |= _BV(UDRIE0);
}

}  // namespace uart
}  // namespace setae

ISR(USART_RX_vect) {
  // The flags belong to the byte and are gone once it is read. A byte that is dropped here, or
  // one that was overrun, costs the frame its CRC; the decoder counts it.
  const uint8_t flags = UCSR0A;
  const uint8_t byte = UDR0;
  if (flags & _BV(FE0))
    return;
  setae::uart::received.push(byte);
}

ISR(USART_UDRE_vect) {
  uint8_t byte;
  if (setae::uart::waiting.pop(byte)) {
    UDR0 = byte;
  } else {
    UCSR0B &= static_cast<uint8_t>(~_BV(UDRIE0));
  }
}
