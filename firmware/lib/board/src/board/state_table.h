// What the board may do when: every mode against every event, once.
//
// Modes are the protocol's states; those in which the board moves by itself are told apart by
// what moves. Board asks this table and keeps no second opinion.
#pragma once

#include <stdint.h>

#include "protocol/flash.h"
#include "protocol/messages.h"

namespace setae {

enum class Mode : uint8_t {
  kRelaxed,
  kAttaching,  // moving: the servos get their pulses one by one
  kHolding,
  kPlaying,    // moving: segments
  kUnwinding,  // moving: towards the free length, then relaxed
  kStopped,
  kTripped,
  kReflex,  // tripped: the retract is under way
  kFault,
};
constexpr uint8_t kModeCount = 9;

enum class Event : uint8_t {
  // Commands of the host.
  kEnable,
  kSegments,
  kGuard,
  kDisarm,
  kRelax,
  kLimp,
  kSetLimits,
  kResumeDetached,  // resume, no servo having pulses
  kResumePartly,    // resume, some having them: attaching was cut short
  kResumeAttached,  // resume, all having them
  kStop,
  // What follows from the link.
  kNewSession,
  kMotionRefused,  // a `segments` or `guard` was refused
  // What the board finds out.
  kAttached,     // the last servo has its pulses
  kPlay,         // the queue has something, and nothing has to be waited for
  kQueueEmpty,   // the last segment's end is put out
  kUnwound,      // the free length is reached
  kHoldTimeout,  // held too long without a host
  kTrip,         // stay
  kTripRetract,  // and retract
  kReflexDone,
  kFault,
};
constexpr uint8_t kEventCount = 22;

// Next mode, or why not.
class Cell {
 public:
  static constexpr Cell go(Mode mode) { return Cell(static_cast<uint8_t>(mode)); }
  static constexpr Cell refuse(protocol::Refusal reason) {
    return Cell(static_cast<uint8_t>(kRefuse | static_cast<uint8_t>(reason)));
  }
  // The board does not let it come to this: where it does, that is an internal fault.
  static constexpr Cell never() { return Cell(kNever); }
  static constexpr Cell from_byte(uint8_t byte) { return Cell(byte); }

  constexpr bool is_never() const { return byte_ == kNever; }
  constexpr bool is_refusal() const { return !is_never() && (byte_ & kRefuse) != 0; }
  constexpr bool is_mode() const { return (byte_ & kRefuse) == 0; }
  constexpr Mode mode() const { return static_cast<Mode>(byte_); }
  constexpr protocol::Refusal reason() const {
    return static_cast<protocol::Refusal>(byte_ & ~kRefuse);
  }
  constexpr uint8_t byte() const { return byte_; }

 private:
  static constexpr uint8_t kRefuse = 0x80;
  static constexpr uint8_t kNever = 0xFF;

  constexpr explicit Cell(uint8_t byte) : byte_(byte) {}

  uint8_t byte_;
};

namespace state_table {

// Short names, so that the table's rows fit a line each.
constexpr uint8_t Relaxed = Cell::go(Mode::kRelaxed).byte();
constexpr uint8_t Attach = Cell::go(Mode::kAttaching).byte();
constexpr uint8_t Holding = Cell::go(Mode::kHolding).byte();
constexpr uint8_t Playing = Cell::go(Mode::kPlaying).byte();
constexpr uint8_t Unwind = Cell::go(Mode::kUnwinding).byte();
constexpr uint8_t Stopped = Cell::go(Mode::kStopped).byte();
constexpr uint8_t Tripped = Cell::go(Mode::kTripped).byte();
constexpr uint8_t Reflex = Cell::go(Mode::kReflex).byte();
constexpr uint8_t Fault = Cell::go(Mode::kFault).byte();
constexpr uint8_t never = Cell::never().byte();
constexpr uint8_t not_on = Cell::refuse(protocol::Refusal::kNotEnabled).byte();
constexpr uint8_t is_on = Cell::refuse(protocol::Refusal::kAlreadyEnabled).byte();
constexpr uint8_t busy = Cell::refuse(protocol::Refusal::kBusy).byte();
constexpr uint8_t stopped = Cell::refuse(protocol::Refusal::kStopped).byte();
constexpr uint8_t tripped = Cell::refuse(protocol::Refusal::kTripped).byte();
constexpr uint8_t reflex = Cell::refuse(protocol::Refusal::kReflexRunning).byte();
constexpr uint8_t fault = Cell::refuse(protocol::Refusal::kFault).byte();

// A capital is the next mode, a small letter a reason for refusal.
// clang-format off
constexpr uint8_t kCells[kEventCount][kModeCount] SETAE_FLASH = {
//                     relaxed  attaching holding  playing  unwinding stopped  tripped  reflex   fault
/* enable          */ {Attach,  is_on,    is_on,   is_on,   is_on,    stopped, tripped, tripped, fault},
/* segments        */ {not_on,  busy,     Holding, Playing, busy,     stopped, tripped, tripped, fault},
/* guard           */ {not_on,  busy,     Holding, busy,    busy,     stopped, tripped, tripped, fault},
/* disarm          */ {Relaxed, Attach,   Holding, busy,    Unwind,   Stopped, Tripped, Reflex,  Fault},
/* relax           */ {Relaxed, busy,     Unwind,  busy,    busy,     stopped, tripped, tripped, fault},
/* limp            */ {Relaxed, Relaxed,  Relaxed, Relaxed, Relaxed,  Stopped, Tripped, Tripped, Fault},
/* set_limits      */ {Relaxed, busy,     is_on,   busy,    busy,     stopped, tripped, tripped, fault},
/* resume_detached */ {Relaxed, never,    never,   never,   never,    Relaxed, Relaxed, never,   Relaxed},
/* resume_partly   */ {never,   Attach,   never,   never,   never,    Attach,  Attach,  never,   Attach},
/* resume_attached */ {never,   Attach,   Holding, Playing, Unwind,   Holding, Holding, reflex,  Holding},
/* stop            */ {Stopped, Stopped,  Stopped, Stopped, Stopped,  Stopped, Stopped, Stopped, Fault},
/* new_session     */ {Relaxed, Attach,   Holding, Holding, Holding,  Stopped, Tripped, Reflex,  Fault},
/* motion_refused  */ {Relaxed, Attach,   Holding, Holding, Unwind,   Stopped, Tripped, Reflex,  Fault},
/* attached        */ {never,   Holding,  never,   never,   never,    never,   never,   never,   never},
/* play            */ {never,   never,    Playing, Playing, never,    never,   never,   never,   never},
/* queue_empty     */ {never,   never,    never,   Holding, never,    never,   never,   never,   never},
/* unwound         */ {never,   never,    never,   never,   Relaxed,  never,   never,   never,   never},
/* hold_timeout    */ {never,   never,    Unwind,  never,   never,    never,   never,   never,   never},
/* trip            */ {never,   Tripped,  Tripped, Tripped, Tripped,  never,   never,   Tripped, never},
/* trip_retract    */ {never,   never,    Reflex,  Reflex,  never,    never,   never,   never,   never},
/* reflex_done     */ {never,   never,    never,   never,   never,    never,   never,   Tripped, never},
/* fault           */ {Fault,   Fault,    Fault,   Fault,   Fault,    Fault,   Fault,   Fault,   Fault},
};
// clang-format on

}  // namespace state_table

// In board.cpp: each file that read the table would get a copy of it.
Cell look_up(Mode mode, Event event);

constexpr protocol::State state_of(Mode mode) {
  return mode == Mode::kRelaxed   ? protocol::State::kRelaxed
         : mode == Mode::kHolding ? protocol::State::kHolding
         : mode == Mode::kStopped ? protocol::State::kStopped
         : mode == Mode::kTripped ? protocol::State::kTripped
         : mode == Mode::kReflex  ? protocol::State::kTripped
         : mode == Mode::kFault   ? protocol::State::kFault
                                  : protocol::State::kMoving;
}

}  // namespace setae
