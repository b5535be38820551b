#include "hal_uno/servo_pulses.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

// Timer1 runs at 0.5 us a tick. Its unit A walks through the frame (frame_start is F):
//
//   F           the pulses last set become this frame's
//   F + kRise   OC1A, OC1B, OC2A and OC2B rise; the first two fall by themselves after their width
//   (OC1A's fall)
//
// Timer2 has 8 bits only: it matches every 128 us. So Timer0's unit B wakes ahead of each of its
// falls and arms it for Timer2's next match. Timers 1 and 2 start together and divide alike, hence
// Timer2 equals the low byte of Timer1. Timer0 counts 32 of their ticks at a time, which is exact
// enough to wake by.
//
// A handler arms an edge and never makes one. One that comes late is counted. Too late for the rise
// it leaves the frame's pulses out; after that pulses stay whole as long as their fall can still be
// armed, and are ended at once where it can't.

namespace setae {
namespace servo_pulses {
namespace {

constexpr uint16_t kFrameTicks = protocol::kServoFrameUs * protocol::kPulseTicksPerUs;
// Handlers wait 25 us at worst (see firmware/README.md). One that begins later than this counts as
// late; the rest is for its own work.
constexpr uint16_t kLateTicks = 90;
constexpr uint16_t kWorkTicks = 25;
constexpr uint16_t kRise = 120;
// A fall of Timer2's is armed so long before it. Timer0 may wake up to two of its ticks early.
constexpr uint16_t kTimer0Ticks = 32;
constexpr uint16_t kFallAhead = 180;
constexpr uint16_t kFallAheadMost = kFallAhead + 2 * kTimer0Ticks;
// So long after the rise the falls can still be armed.
constexpr uint16_t kLatestFallTicks = 600;
static_assert(kLatestFallTicks + kFallAheadMost + kWorkTicks < protocol::kPulseTicksAbsoluteMin,
              "the shortest pulse would be over");
static_assert(kRise > kLateTicks + kWorkTicks, "an edge must be armed before it is due");
static_assert(kFallAhead > kLateTicks + kWorkTicks, "an edge must be armed before it is due");
static_assert(kRise < 256 && kFallAheadMost < 256, "Timer2 would match too early");
static_assert(protocol::kPulseTicksAbsoluteMin > kFallAheadMost + kLateTicks, "");
static_assert(kRise + protocol::kPulseTicksAbsoluteMax < 255 * kTimer0Ticks, "Timer0 wraps");

// At its next match the unit lowers its pin, or raises it.
constexpr uint8_t kLower1 = _BV(COM1A1) | _BV(COM1B1);
constexpr uint8_t kLower2 = _BV(COM2A1) | _BV(COM2B1);
constexpr uint8_t kRaise1A = _BV(COM1A0);
constexpr uint8_t kRaise1B = _BV(COM1B0);
constexpr uint8_t kRaise2A = _BV(COM2A0);
constexpr uint8_t kRaise2B = _BV(COM2B0);
constexpr uint8_t kRaise[protocol::kServos] = {kRaise1A, kRaise1B, kRaise2A, kRaise2B};

// Timer0's ticks, rounded down, until a fall has to be armed that is so far away.
constexpr uint8_t timer0_wait(uint16_t ticks) {
  return static_cast<uint8_t>(static_cast<uint16_t>(ticks - kFallAhead) * (256 / kTimer0Ticks) /
                              256);
}

// One frame's pulses as the handlers use them.
struct Output {
  uint16_t end[protocol::kServos];  // from the frame's start
  uint8_t wait;                     // Timer0's ticks, from the rise to the first wake
  uint8_t rise1;                    // for TCCR1A: a servo without pulses is lowered once more
  uint8_t rise2;                    // for TCCR2A
};

// One is this frame's, the other the loop may write, with interrupts off.
Output outputs[2];
Output* current = &outputs[0];
Output* wanted = &outputs[0];
uint32_t frame;
uint16_t frame_start;
uint8_t step;
uint8_t late;

}  // namespace

void begin() {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    TIMSK2 = 0;
    TCCR1B = 0;
    TCCR2B = 0;
    // First the level, then the pin. Data sheet section 16.7: by a forced match.
    TCCR1A = kLower1;
    TCCR2A = kLower2;
    TCCR1C = _BV(FOC1A) | _BV(FOC1B);
    TCCR2B = _BV(FOC2A) | _BV(FOC2B);
    PORTB &= static_cast<uint8_t>(~(_BV(PORTB1) | _BV(PORTB2) | _BV(PORTB3)));
    PORTD &= static_cast<uint8_t>(~_BV(PORTD3));
    DDRB |= _BV(DDB1) | _BV(DDB2) | _BV(DDB3);
    DDRD |= _BV(DDD3);
    TCCR0A = 0;
    TCCR0B = _BV(CS02);                             // 16 MHz / 256
    GTCCR = _BV(TSM) | _BV(PSRASY) | _BV(PSRSYNC);  // hold both prescalers
    TCNT1 = 0;
    TCNT2 = 0;
    TCCR1B = _BV(CS11);  // 16 MHz / 8
    TCCR2B = _BV(CS21);
    set(Pulses{}, 0);  // falls in the past would come a timer's turn later
    OCR1A = kFrameTicks;
    TIFR1 = _BV(OCF1A);
    TIMSK1 = _BV(OCIE1A);
    GTCCR = 0;  // go, both in the same cycle
  }
}

uint32_t set(const Pulses& pulses, uint8_t attached) {
  Output output;
  output.rise1 = kLower1;
  output.rise2 = kLower2;
  for (uint8_t i = 0; i < protocol::kServos; ++i) {
    uint16_t ticks = pulses.ticks[i];
    // An edge in the past would come a timer's turn later: keep the handlers' order whatever
    // is asked.
    if (ticks < protocol::kPulseTicksAbsoluteMin)
      ticks = protocol::kPulseTicksAbsoluteMin;
    if (ticks > protocol::kPulseTicksAbsoluteMax)
      ticks = protocol::kPulseTicksAbsoluteMax;
    output.end[i] = ticks + kRise;
    if ((attached >> i) & 1)
      (i < 2 ? output.rise1 : output.rise2) |= kRaise[i];
  }
  const uint16_t first = output.end[2] < output.end[3] ? output.end[2] : output.end[3];
  output.wait = timer0_wait(first - kRise);
  uint32_t running;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    wanted = current == &outputs[0] ? &outputs[1] : &outputs[0];
    *wanted = output;
    running = frame;
  }
  return running;
}

void detach_from_interrupt() {
  Output* const next = current == &outputs[0] ? &outputs[1] : &outputs[0];
  next->rise1 = kLower1;
  next->rise2 = kLower2;
  wanted = next;
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

uint32_t frame_number() {
  uint32_t number;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    number = frame;
  }
  return number;
}

bool frame_ends_within(uint16_t us) {
  uint16_t elapsed;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    elapsed = TCNT1 - frame_start;
  }
  return elapsed >= kFrameTicks - us * protocol::kPulseTicksPerUs;
}

BoardTime at(uint16_t then) {
  BoardTime time = now();
  const uint16_t ago_us = static_cast<uint16_t>(ticks() - then) / protocol::kPulseTicksPerUs;
  if (time.phase_us >= ago_us) {
    time.phase_us -= ago_us;
  } else {
    time.phase_us += protocol::kServoFrameUs - ago_us;
    --time.frame;
  }
  return time;
}

uint16_t ticks() {
  uint16_t count;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    count = TCNT1;
  }
  return count;
}

uint8_t late_armings() {
  return late;
}

}  // namespace servo_pulses
}  // namespace setae

ISR(TIMER1_COMPA_vect) {
  using namespace setae::servo_pulses;
  const uint16_t woke = OCR1A;
  const uint8_t now_step = step;
  const uint16_t waited = TCNT1 - woke;
  const bool on_time = waited <= kLateTicks;
  step = now_step + 1;
  if (now_step == 0) {  // woke at F
    frame_start = woke;
    ++frame;
    current = wanted;
    if (on_time) {
      // First where, then what: until then a match repeats the level that the pin has.
      OCR1A = woke + kRise;
      OCR1B = woke + kRise;
      OCR2A = static_cast<uint8_t>(woke + kRise);
      OCR2B = static_cast<uint8_t>(woke + kRise);
      TCCR1A = current->rise1;
      TCCR2A = current->rise2;
      return;
    }
    ++late;
  } else if (now_step == 1) {  // all four are up
    TCCR1A = kLower1;
    uint8_t wait = current->wait;
    if (!on_time) {
      ++late;
      wait -= static_cast<uint8_t>(waited / kTimer0Ticks + 1);
    }
    if (waited <= kLatestFallTicks) {
      OCR1A = frame_start + current->end[0];
      OCR1B = frame_start + current->end[1];
      OCR0B = static_cast<uint8_t>(TCNT0 + wait);
      TIFR0 = _BV(OCF0B);
      TIMSK0 |= _BV(OCIE0B);
      return;
    }
    TCCR2A = kLower2;
    TCCR1C = _BV(FOC1A) | _BV(FOC1B);
    TCCR2B |= _BV(FOC2A) | _BV(FOC2B);
  }  // else servo 0's pulse is over
  step = 0;
  OCR1A = frame_start + kFrameTicks;
}

// Ahead of the fall of servo 2's pulse, or 3's, or both. One that is to fall yet is in the mode in
// which it rose.
ISR(TIMER0_COMPB_vect) {
  using namespace setae::servo_pulses;
  const uint16_t now = TCNT1 - frame_start;
  uint8_t mode = TCCR2A;
  uint16_t soonest = 0;
  if (mode & kRaise2A) {
    const int16_t left = static_cast<int16_t>(current->end[2] - now);
    if (left <= static_cast<int16_t>(kFallAheadMost)) {
      OCR2A = static_cast<uint8_t>(frame_start + current->end[2]);
      mode &= static_cast<uint8_t>(~kRaise2A);
      TCCR2A = mode;
      if (left < static_cast<int16_t>(kWorkTicks)) {
        TCCR2B |= _BV(FOC2A);
        ++late;
      }
    } else {
      soonest = static_cast<uint16_t>(left);
    }
  }
  if (mode & kRaise2B) {
    const int16_t left = static_cast<int16_t>(current->end[3] - now);
    if (left <= static_cast<int16_t>(kFallAheadMost)) {
      OCR2B = static_cast<uint8_t>(frame_start + current->end[3]);
      mode &= static_cast<uint8_t>(~kRaise2B);
      TCCR2A = mode;
      if (left < static_cast<int16_t>(kWorkTicks)) {
        TCCR2B |= _BV(FOC2B);
        ++late;
      }
    } else if (soonest == 0 || static_cast<uint16_t>(left) < soonest) {
      soonest = static_cast<uint16_t>(left);
    }
  }
  if (soonest != 0) {
    OCR0B = static_cast<uint8_t>(TCNT0 + timer0_wait(soonest));
  } else {
    TIMSK0 &= static_cast<uint8_t>(~_BV(OCIE0B));
  }
}
