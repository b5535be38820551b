#include "hal_uno/servo_pulses.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

// Timer1 runs at 0.5 us a tick. Its unit A walks through the frame (frame_start is F):
//
//   F              the pulses last set become this frame's
//   F + rise 0     OC1A rises; + width: it falls
//   F + rise 1     OC1B rises; + width: it falls (unit B, by itself)
//   F + rise 2     OC2A rises; + width: it falls
//   F + rise 3     OC2B rises; + width: it falls
//
// Timer2 has 8 bits only: it matches every 128 us. So for its edges unit A wakes a little ahead
// and arms the edge for Timer2's next match. Both timers start together and divide alike, hence
// Timer2 equals the low byte of Timer1.

namespace setae {
namespace servo_pulses {
namespace {

constexpr uint16_t kFrameTicks = protocol::kServoFrameUs * protocol::kPulseTicksPerUs;
constexpr uint16_t kSlotTicks = kFrameTicks / protocol::kServos;
// From the frame's start to the first edge, and from waking to Timer2's edge: longer than the
// longest time in which interrupts wait (28 us measured), shorter than Timer2's period.
constexpr uint16_t kAheadTicks = 120;
constexpr uint16_t kFirstRise = 200;
static_assert(kFirstRise > kAheadTicks, "");
static_assert(kAheadTicks < 256, "Timer2 would match too early");
static_assert(protocol::kPulseTicksAbsoluteMin > 2 * kAheadTicks, "");
static_assert(kFirstRise + protocol::kPulseTicksAbsoluteMax + kAheadTicks < kSlotTicks,
              "a pulse must end before the next one begins");

constexpr uint16_t rise(uint8_t servo) {
  return kFirstRise + servo * kSlotTicks;
}

constexpr uint8_t kSet1A = _BV(COM1A1) | _BV(COM1A0);
constexpr uint8_t kSet1B = _BV(COM1B1) | _BV(COM1B0);
constexpr uint8_t kSet2A = _BV(COM2A1) | _BV(COM2A0);
constexpr uint8_t kSet2B = _BV(COM2B1) | _BV(COM2B0);

struct Output {
  uint16_t width[protocol::kServos];
  uint8_t attached;
};

Output wanted;   // written by the loop with interrupts off
Output current;  // only the handlers touch it
uint32_t frame;
uint16_t frame_start;
uint8_t step_a;
uint8_t step_b;

bool attached(uint8_t servo) {
  return (current.attached >> servo) & 1;
}

void clear_bits(volatile uint8_t& reg, uint8_t bits) {
  reg &= static_cast<uint8_t>(~bits);
}

void start_frame() {
  current = wanted;
  frame_start += kFrameTicks;
  ++frame;
  OCR1A = frame_start + rise(0);
  OCR1B = frame_start + rise(1);
  step_b = 0;
  if (attached(0))
    TCCR1A |= kSet1A;
  if (attached(1))
    TCCR1A |= kSet1B;
  // A detached pin falls back to its port bit, which is low.
  if (!attached(2))
    clear_bits(TCCR2A, kSet2A);
  if (!attached(3))
    clear_bits(TCCR2A, kSet2B);
}

}  // namespace

void begin() {
  clear_bits(PORTB, _BV(PORTB1) | _BV(PORTB2) | _BV(PORTB3));
  clear_bits(PORTD, _BV(PORTD3));
  DDRB |= _BV(DDB1) | _BV(DDB2) | _BV(DDB3);
  DDRD |= _BV(DDD3);
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    TIMSK0 = 0;  // the Arduino core's millis(), which nothing here uses
    TIMSK2 = 0;
    TCCR1A = 0;
    TCCR1B = 0;
    TCCR2A = 0;
    TCCR2B = 0;
    GTCCR = _BV(TSM) | _BV(PSRASY) | _BV(PSRSYNC);  // hold both prescalers
    TCNT1 = 0;
    TCNT2 = 0;
    TCCR1B = _BV(CS11);  // 16 MHz / 8
    TCCR2B = _BV(CS21);
    OCR1A = kFrameTicks;
    TIFR1 = _BV(OCF1A) | _BV(OCF1B);
    TIMSK1 = _BV(OCIE1A) | _BV(OCIE1B);
    GTCCR = 0;  // go, both in the same cycle
  }
}

uint32_t set(const Pulses& pulses, uint8_t attached) {
  Output output;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    uint16_t ticks = pulses.ticks[i];
    // An edge in the past would come a timer's turn later: keep the handlers' order whatever
    // is asked.
    if (ticks < protocol::kPulseTicksAbsoluteMin)
      ticks = protocol::kPulseTicksAbsoluteMin;
    if (ticks > protocol::kPulseTicksAbsoluteMax)
      ticks = protocol::kPulseTicksAbsoluteMax;
    output.width[i] = ticks;
  }
  output.attached = attached;
  uint32_t running;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    wanted = output;
    running = frame;
  }
  return running;
}

void detach_from_interrupt() {
  wanted.attached = 0;
}

BoardTime now() {
  BoardTime time;
  uint16_t elapsed;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    time.frame = frame;
    elapsed = TCNT1 - frame_start;
  }
  // The next frame is due, and its handler about to run.
  if (elapsed >= kFrameTicks)
    elapsed = kFrameTicks - 1;
  time.phase_us = elapsed / protocol::kPulseTicksPerUs;
  return time;
}

uint16_t ticks() {
  uint16_t count;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    count = TCNT1;
  }
  return count;
}

}  // namespace servo_pulses
}  // namespace setae

ISR(TIMER1_COMPA_vect) {
  using namespace setae::servo_pulses;
  const uint16_t start = frame_start;
  switch (step_a++) {
    case 0:
      start_frame();
      break;
    case 1:  // OC1A rose; the next match lowers it
      clear_bits(TCCR1A, _BV(COM1A0));
      OCR1A = start + rise(0) + current.width[0];
      break;
    case 2:
      clear_bits(TCCR1A, kSet1A);
      OCR1A = start + rise(2) - kAheadTicks;
      break;
    case 3:
      // First where, then what: until then a match repeats the level that the pin has.
      OCR2A = static_cast<uint8_t>(start + rise(2));
      if (attached(2))
        TCCR2A |= kSet2A;
      OCR1A = start + rise(2) + current.width[2] - kAheadTicks;
      break;
    case 4:
      OCR2A = static_cast<uint8_t>(start + rise(2) + current.width[2]);
      clear_bits(TCCR2A, _BV(COM2A0));
      OCR1A = start + rise(3) - kAheadTicks;
      break;
    case 5:
      OCR2B = static_cast<uint8_t>(start + rise(3));
      if (attached(3))
        TCCR2A |= kSet2B;
      OCR1A = start + rise(3) + current.width[3] - kAheadTicks;
      break;
    default:
      OCR2B = static_cast<uint8_t>(start + rise(3) + current.width[3]);
      clear_bits(TCCR2A, _BV(COM2B0));
      OCR1A = start + kFrameTicks;
      step_a = 0;
      break;
  }
}

ISR(TIMER1_COMPB_vect) {
  using namespace setae::servo_pulses;
  if (step_b++ == 0) {
    clear_bits(TCCR1A, _BV(COM1B0));
    OCR1B = frame_start + rise(1) + current.width[1];
  } else {
    clear_bits(TCCR1A, kSet1B);
  }
}
