// A host that lies: random bytes and random messages, valid and not, and a bristle that touches
// when it likes. Whatever comes, each servo frame must be one that the robot survives.
#include <doctest/doctest.h>
#include <stdlib.h>

#include <random>
#include <string>

#include "../support/rig.h"

using namespace setae;
using protocol::Sensor;
using protocol::State;

namespace {

class Liar {
 public:
  explicit Liar(uint32_t seed) : random_(seed) { rig.open(); }

  void act() {
    const bool armed = !rig.telemetries.empty() &&
                       rig.telemetry().guard == static_cast<uint8_t>(protocol::Guard::kArmed);
    if (armed && below(10) == 0)
      rig.sensor = static_cast<Sensor>(1 + below(5));
    switch (below(24)) {
      case 0:
        return noise();
      case 1:
        return rig.send(protocol::Stop{byte()});
      case 2:
        return rig.send(protocol::Acknowledge{static_cast<uint8_t>(below(4)), byte()});
      case 3:
        return rig.acknowledge_all();
      case 4:
        return rig.send(protocol::Recall{static_cast<uint8_t>(below(4))});
      case 5:
        if (below(8) == 0)
          rig.open(byte());
        return;
      case 6:
      case 7:
        return send(Rig::enable(static_cast<uint16_t>(below(8) ? 1700 + below(600) : word())));
      case 8:
      case 9:
      case 10:
        return send(protocol::Resume{below(4) ? rig.header.epoch : byte()});
      case 11:
        return send(
            protocol::Relax{static_cast<uint16_t>(below(130)), {kFree, kFree, kFree, kFree}});
      case 12:
        if (below(4) == 0)
          send(protocol::Limp{});
        return;
      case 13:
        return send(limits());
      case 14:
      case 15:
        return send(guard());
      case 16:
        return send(protocol::Disarm{});
      case 17:
        rig.pressure_raw = (1013 + static_cast<int32_t>(below(200)) - 100) * kHpa;
        return;
      case 18:
        rig.pressure_raw = 1013 * kHpa;
        rig.sensor = Sensor::kOk;
        return;
      default:
        return send(segments());
    }
  }

  uint32_t below(uint32_t bound) { return static_cast<uint32_t>(random_() % bound); }

  Rig rig;

 private:
  uint8_t byte() { return static_cast<uint8_t>(random_()); }
  uint16_t word() { return static_cast<uint16_t>(random_()); }

  void noise() {
    for (uint32_t i = below(40); i > 0; --i)
      rig.hal.push_rx(below(5) ? byte() : 0);
    rig.hal.push_rx(0);
    rig.poll();
  }

  template <typename Message>
  void send(const Message& message) {
    if (below(10) == 0) {
      rig.send(message, byte());  // out of sequence, mostly
      rig.next_sequence = rig.header.expected;
    } else {
      rig.next_sequence = rig.header.expected;
      rig.command(message);
    }
  }

  protocol::Segments segments() {
    protocol::Segments message = {};
    message.epoch = below(8) ? rig.header.epoch : byte();
    message.count = static_cast<uint8_t>(below(20) ? 1 + below(5) : byte());
    for (protocol::Segment& segment : message.segments) {
      const uint16_t ticks = static_cast<uint16_t>(1700 + below(800));
      segment.duration_frames = static_cast<uint16_t>(below(20) ? 5 + below(40) : word());
      for (uint16_t& target : segment.target_ticks) {
        target = static_cast<uint16_t>(below(100) ? ticks + below(200) : word());
      }
    }
    return message;
  }

  protocol::GuardMessage guard() {
    protocol::GuardMessage message = rig.guard(static_cast<protocol::Reflex>(below(2)));
    for (uint16_t& ticks : message.retract_ticks) {
      ticks = static_cast<uint16_t>(1700 + below(300));
    }
    if (below(6) == 0)
      message.deadline_frames = static_cast<uint16_t>(below(60));
    if (below(10) == 0)
      message.threshold_raw = static_cast<uint32_t>(random_());
    if (below(10) == 0)
      message.retract_slew_ticks = word();
    if (below(10) == 0)
      message.reflex = byte();
    return message;
  }

  protocol::SetLimits limits() {
    protocol::SetLimits message = kDefaultLimits;
    if (below(3) == 0)
      message.pulse_max_ticks[below(4)] = word();
    if (below(3) == 0)
      message.hold_timeout_s = 1;
    return message;
  }

  std::mt19937 random_;
};

// What is wrong with the newest frame; empty where nothing is.
std::string fault_of(const Rig& rig, Mode mode_before) {
  const Rig::Output& now = rig.outputs.back();
  const Rig::Output& before = rig.outputs[rig.outputs.size() - 2];
  const protocol::SetLimits& bounds = kDefaultLimits;  // the widest that the liar can set
  bool moved = false;
  // Limp and enable between two frames: the host chose another pose to attach at.
  const bool attached_anew = now.attached == 1;
  for (int i = 0; i < 4; ++i) {
    if (((now.attached >> i) & 1) == 0)
      continue;
    const int ticks = now.pulses.ticks[i];
    if (ticks < protocol::kPulseTicksAbsoluteMin || ticks > protocol::kPulseTicksAbsoluteMax) {
      return "outside the absolute bounds";
    }
    if (ticks < bounds.pulse_min_ticks[i])
      return "below the limit";
    if (((before.attached >> i) & 1) == 0 || attached_anew)
      continue;
    const int step = abs(ticks - before.pulses.ticks[i]);
    if (step > bounds.slew_ticks)
      return "faster than the slew limit";
    moved = moved || step != 0;
  }
  for (int pair = 0; pair < 2 && now.attached == kAllServos; ++pair) {
    const int a = now.pulses.ticks[pair];
    const int b = now.pulses.ticks[pair + 2];
    // A line is rounded to one tick for each servo.
    if (a + b > bounds.pair_sum_max_ticks[pair] + 1)
      return "crushes the spring";
    if (a - b > bounds.pair_difference_max_ticks[pair] + 1)
      return "bends too far";
    if (a - b < bounds.pair_difference_min_ticks[pair] - 1)
      return "bends too far the other way";
  }
  if (__builtin_popcount(now.attached) > __builtin_popcount(before.attached) + 1) {
    return "two servos attached at once";
  }
  const Mode mode = rig.board->mode();
  const bool may_move = mode_before == Mode::kPlaying || mode_before == Mode::kUnwinding ||
                        mode_before == Mode::kReflex || mode == Mode::kPlaying ||
                        mode == Mode::kUnwinding || mode == Mode::kReflex;
  if (moved && !may_move)
    return "moves without leave";
  if (rig.malformed != 0)
    return "a frame that the host can't read";
  for (const auto& heard : rig.faults) {
    if (heard.message.fault == static_cast<uint8_t>(protocol::Fault::kInternal)) {
      return "an internal fault";
    }
  }
  return "";
}

}  // namespace

TEST_CASE("no host, however wrong, gets the robot outside its limits") {
  int moved = 0;
  int trips = 0;
  int faults = 0;
  int refusals = 0;
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    CAPTURE(seed);
    Liar liar(seed);
    Rig& rig = liar.rig;
    std::string wrong;
    for (int i = 0; i < 1500 && wrong.empty(); ++i) {
      liar.act();
      if (liar.below(2))
        continue;
      for (uint32_t frames = 1 + liar.below(6); frames > 0 && wrong.empty(); --frames) {
        // A mode that begins and ends between two frames can't move anything; what counts is
        // the one that the frame was computed in.
        const Mode before = rig.board->mode();
        rig.run_frames(1);
        wrong = fault_of(rig, before);
      }
    }
    CHECK(wrong == "");
    for (size_t i = 1; i < rig.outputs.size(); ++i) {
      moved += rig.outputs[i].pulses.ticks[0] != rig.outputs[i - 1].pulses.ticks[0];
    }
    trips += !rig.trips.empty();
    faults += !rig.faults.empty();
    refusals += !rig.refusals.empty();
  }
  // It was no walk through one room.
  CHECK(moved > 1000);
  CHECK(trips > 10);
  CHECK(faults > 10);
  CHECK(refusals == 40);
}

TEST_CASE("noise on the line moves nothing and opens no session") {
  Rig rig;
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    for (int byte = 0; byte < 100; ++byte)
      rig.hal.push_rx(static_cast<uint8_t>(random()));
    rig.run_frames(1);
  }
  CHECK(rig.header.session == 0);
  CHECK(rig.hal.attached() == 0);
  CHECK(rig.board->mode() == Mode::kRelaxed);
}
