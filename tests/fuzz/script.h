// An input as a play: what a host, a line, a sensor and a power supply do to a board, one action
// after the other. The host knows the protocol well, so that most of what it says is valid, and
// says wrong things on purpose.
#pragma once

#include "bench.h"
#include "input.h"

namespace setae {
namespace fuzz {

class Script {
 public:
  Script(Bench& bench, Input& input) : bench_(bench), input_(input) {}

  void play();

 private:
  // What is wrong with the next message.
  enum class Twist : uint8_t {
    kNone,
    kForeignSession,
    kNoSession,
    kOldSequence,
    kGapSequence,
    kAnySequence,
    kFlippedBit,
    kLostByte,
  };

  void begin(uint8_t how);
  void act();
  void act_on_line(uint8_t which, uint8_t variant);
  void act_on_motion(uint8_t which, uint8_t variant);
  void act_on_world(uint8_t which, uint8_t variant);

  void hello(uint8_t variant);
  void enable(uint8_t variant);
  void segments(uint8_t variant);
  void guard(uint8_t variant);
  void set_limits(uint8_t variant);
  void raw(uint8_t variant);
  void run_frames(uint32_t frames);

  uint8_t epoch();
  void pose(uint16_t* ticks);
  uint16_t duration_frames(const uint16_t* from, const uint16_t* to);

  template <typename Message>
  void send(const Message& message);
  void send_inside(const uint8_t* inside, size_t size);

  Bench& bench_;
  Input& input_;
  uint32_t frames_left_ = 200;
  Twist twist_ = Twist::kNone;
  bool old_epoch_ = false;
  uint8_t next_session_ = 7;
  uint8_t stop_number_ = 0;
  uint16_t end_ticks_[protocol::kServos] = {1700, 1700, 1700, 1700};
};

}  // namespace fuzz
}  // namespace setae
