// One poll of the board, as its observers see it: how the board was, what came in, how it is now.
#pragma once

#include <string.h>

#include "board/board.h"
#include "reference.h"

namespace setae {

// What of the board is not on the line at every moment.
struct Snapshot {
  Mode mode;
  uint32_t frame;  // the last that the board has begun
  uint8_t epoch;
  uint8_t session;
  uint8_t expected;
  uint8_t queued;
  uint8_t attached;
  protocol::Guard guard;
  int32_t baseline_raw;
  bool refusal_pending;
  protocol::Sensor sensor;
  protocol::SetLimits limits;
};

// The one place that looks into Board.
struct BoardProbe {
  static Snapshot look(const Board& board) {
    Snapshot shot = {};
    shot.mode = board.mode_;
    shot.frame = board.frame_;
    shot.epoch = board.epoch_;
    shot.session = board.session_.id();
    shot.expected = board.session_.expected();
    shot.queued = board.player_.queued();
    shot.attached = board.attached_;
    shot.guard = board.detector_.guard();
    shot.baseline_raw = board.detector_.baseline_raw();
    shot.refusal_pending = board.refusal_.pending();
    shot.sensor = board.sensor_;
    shot.limits = board.limits_.in_force();
    return shot;
  }
};

namespace fuzz {

inline bool is_latched(Mode mode) {
  return mode == Mode::kStopped || mode == Mode::kTripped || mode == Mode::kReflex ||
         mode == Mode::kFault;
}
inline bool is_tripped(Mode mode) {
  return mode == Mode::kTripped || mode == Mode::kReflex;
}

struct Step {
  Snapshot before;
  Snapshot after;
  bool frame_began;  // for the board: it may see a frame's begin a poll late
  bool delivered;    // a whole frame of a known type, in `host`
  Inside host;
  SensorReading reading;
  bool stalled;      // nobody reads what the board sends
  bool switch_open;  // the stop switch, if there is one

  protocol::MessageType type() const { return static_cast<protocol::MessageType>(host.bytes[0]); }
  uint8_t session() const { return host.bytes[1]; }
  uint8_t sequence() const { return host.bytes[2]; }

  bool is(protocol::MessageType wanted) const { return delivered && type() == wanted; }
  bool in_session() const { return before.session != 0 && session() == before.session; }
  // The reliable command that the board waits for.
  bool next() const {
    return delivered && protocol::is_reliable(type()) && in_session() &&
           sequence() == before.expected;
  }
  bool is_next(protocol::MessageType wanted) const { return next() && type() == wanted; }
  bool taken() const { return next() && after.expected != before.expected; }
  // A guard was taken, and not discarded or refused.
  bool guards() const {
    return is_next(protocol::MessageType::kGuard) && taken() &&
           after.guard == protocol::Guard::kTaring && after.epoch == before.epoch &&
           read<protocol::GuardMessage>().epoch == before.epoch;
  }
  // A tare failed, and the host has to read another refusal before it hears of this one.
  bool tare_waits() const {
    return before.guard == protocol::Guard::kTaring && before.sensor != protocol::Sensor::kOk;
  }
  // Nothing but the delivered frame can have changed anything.
  bool quiet() const {
    return !frame_began && !reading.fresh && reading.status == protocol::Sensor::kOk &&
           !tare_waits();
  }

  template <typename Message>
  Message read() const {
    Message message;
    decode(host.bytes + protocol::HostHeader::kSize, message);
    return message;
  }
};

}  // namespace fuzz
}  // namespace setae
