#include "hal_uno/uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "protocol/messages.h"

namespace setae {
namespace uart {
namespace {

constexpr uint16_t kDivisor = F_CPU / 16 / protocol::kBaud - 1;
static_assert(F_CPU == 16UL * protocol::kBaud * (kDivisor + 1UL), "the baud rate is not exact");

ReceiveRing ring_in;
TransmitRing ring_out;
// The receive handler's.
LineErrors lost;
uint16_t frame_end_ticks;  // when the last delimiter came

}  // namespace

void begin() {
  UBRR0 = kDivisor;
  UCSR0A = 0;
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);  // 8N1
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ReceiveRing& received() {
  return ring_in;
}

TransmitRing& to_send() {
  return ring_out;
}

LineErrors errors() {
  LineErrors copy;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    copy = lost;
  }
  return copy;
}

bool frame_ended(uint16_t& ticks) {
  bool only;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    ticks = frame_end_ticks;
    only = ring_in.size() == 0;
  }
  return only;
}

}  // namespace uart
}  // namespace setae

// At 500 kBd a byte comes and one goes every 320 cycles, so these two are in assembler: the
// compiler's take 90 cycles each. r24 and SREG wait in two of the registers that are for such use
// (handlers don't nest); one cycle each instead of four.

ISR(USART_RX_vect, ISR_NAKED) {
  using namespace setae::uart;
  asm volatile(
      "out %[r24], r24 \n\t"
      "in r24, __SREG__ \n\t"
      "out %[sreg], r24 \n\t"
      "push r25 \n\t"
      "push r30 \n\t"
      "push r31 \n\t"
      // The flags belong to the byte and are gone once it is read.
      "lds r24, %[ucsra] \n\t"
      "lds r25, %[udr] \n\t"
      "andi r24, %[errors] \n\t"
      "brne 2f \n"
      "1: lds r30, %[head] \n\t"
      "lds r31, %[tail] \n\t"
      "sub r31, r30 \n\t"
      "cpi r31, %[full] \n\t"
      "breq 4f \n\t"
      "mov r24, r30 \n\t"
      "andi r30, %[mask] \n\t"
      "ldi r31, 0 \n\t"
      "subi r30, lo8(-(%[bytes])) \n\t"
      "sbci r31, hi8(-(%[bytes])) \n\t"
      "st Z, r25 \n\t"
      "inc r24 \n\t"
      "sts %[head], r24 \n\t"
      "tst r25 \n\t"
      "breq 5f \n"
      "9: pop r31 \n\t"
      "pop r30 \n\t"
      "pop r25 \n\t"
      "in r24, %[sreg] \n\t"
      "out __SREG__, r24 \n\t"
      "in r24, %[r24] \n\t"
      "reti \n"
      // A byte without a stop bit is none. An overrun lost the byte after this one.
      "2: sbrs r24, %[overrun] \n\t"
      "rjmp 3f \n\t"
      "lds r30, %[lost]+1 \n\t"
      "inc r30 \n\t"
      "sts %[lost]+1, r30 \n"
      "3: sbrs r24, %[frame] \n\t"
      "rjmp 1b \n\t"
      "lds r30, %[lost] \n\t"
      "inc r30 \n\t"
      "sts %[lost], r30 \n\t"
      "rjmp 9b \n"
      "4: lds r30, %[lost]+2 \n\t"
      "inc r30 \n\t"
      "sts %[lost]+2, r30 \n\t"
      "rjmp 9b \n"
      "5: ldi r24, 1 \n\t"
      "sts %[ended], r24 \n\t"
      "lds r24, %[tcntl] \n\t"
      "sts %[ticks], r24 \n\t"
      "lds r24, %[tcnth] \n\t"
      "sts %[ticks]+1, r24 \n\t"
      "rjmp 9b"
      :
      : [r24] "I"(_SFR_IO_ADDR(GPIOR1)), [sreg] "I"(_SFR_IO_ADDR(GPIOR2)),
        [ucsra] "n"(_SFR_MEM_ADDR(UCSR0A)), [udr] "n"(_SFR_MEM_ADDR(UDR0)),
        [errors] "n"(_BV(FE0) | _BV(DOR0)), [overrun] "I"(DOR0), [frame] "I"(FE0),
        [head] "i"(&ring_in.head), [tail] "i"(&ring_in.tail), [bytes] "i"(&ring_in.bytes),
        [full] "n"(256 - setae::kReceiveRingBytes), [mask] "n"(setae::kReceiveRingBytes - 1),
        [ended] "i"(&ring_in.ended), [lost] "i"(&lost), [ticks] "i"(&frame_end_ticks),
        [tcntl] "n"(_SFR_MEM_ADDR(TCNT1L)), [tcnth] "n"(_SFR_MEM_ADDR(TCNT1H)));
}

ISR(USART_UDRE_vect, ISR_NAKED) {
  using namespace setae::uart;
  asm volatile(
      "out %[r24], r24 \n\t"
      "in r24, __SREG__ \n\t"
      "out %[sreg], r24 \n\t"
      "push r30 \n\t"
      "push r31 \n\t"
      "lds r30, %[tail] \n\t"
      "lds r24, %[head] \n\t"
      "cp r24, r30 \n\t"
      "breq 2f \n\t"
      "mov r24, r30 \n\t"
      "inc r24 \n\t"
      "sts %[tail], r24 \n\t"
      "andi r30, %[mask] \n\t"
      "ldi r31, 0 \n\t"
      "subi r30, lo8(-(%[bytes])) \n\t"
      "sbci r31, hi8(-(%[bytes])) \n\t"
      "ld r24, Z \n\t"
      "sts %[udr], r24 \n"
      "1: pop r31 \n\t"
      "pop r30 \n\t"
      "in r24, %[sreg] \n\t"
      "out __SREG__, r24 \n\t"
      "in r24, %[r24] \n\t"
      "reti \n"
      "2: lds r24, %[ucsrb] \n\t"
      "andi r24, %[off] \n\t"
      "sts %[ucsrb], r24 \n\t"
      "rjmp 1b"
      :
      : [r24] "I"(_SFR_IO_ADDR(GPIOR1)), [sreg] "I"(_SFR_IO_ADDR(GPIOR2)),
        [udr] "n"(_SFR_MEM_ADDR(UDR0)), [ucsrb] "n"(_SFR_MEM_ADDR(UCSR0B)),
        [off] "n"(0xFF & ~_BV(UDRIE0)), [head] "i"(&ring_out.head), [tail] "i"(&ring_out.tail),
        [bytes] "i"(&ring_out.bytes), [mask] "n"(setae::kTransmitRingBytes - 1));
}
