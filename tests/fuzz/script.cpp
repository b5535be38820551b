#include "script.h"

#include "board/default_limits.h"
#include "motion/distance.h"

namespace setae {
namespace fuzz {

using protocol::Reflex;
using protocol::Sensor;

namespace {

constexpr uint16_t kFree = HostHal::kFreeTicks;
constexpr int32_t kHpa = protocol::kPressureLsbPerHpa;
constexpr uint32_t kFrameUs = protocol::kServoFrameUs;
constexpr uint16_t kSlew = kDefaultLimits.slew_ticks;
// Just outside, just inside, and absurd.
constexpr uint16_t kOddTicks[] = {0, 999, 1000, 1659, 1660, 4050, 4051, 65535};
constexpr uint16_t kWaits[] = {1, 2, 3, 6, 12, 25, 55, 120};

}  // namespace

void Script::play() {
  begin(input_.byte());
  while (input_.more() && frames_left_ != 0)
    act();
}

// Somewhere to start from, so that not every input has to find its way there.
void Script::begin(uint8_t how) {
  how %= 6;
  if (how == 0)
    return;
  hello(0);
  run_frames(2);
  if (how == 1)
    return;
  enable(0);
  run_frames(23);
  if (how == 2)
    return;
  if (how >= 4) {
    guard(how == 4 ? 0 : 1);
    run_frames(9);
  }
  protocol::Segments message = {};
  message.epoch = bench_.board().epoch;
  message.count = 1;
  message.segments[0] = {40, {2100, 2100, 2100, 2100}};
  for (uint16_t& ticks : end_ticks_)
    ticks = 2100;
  send(message);
  run_frames(3);
}

// The lowest five bits say what, the highest three how.
void Script::act() {
  const uint8_t action = input_.byte();
  const uint8_t which = action & 31;
  const uint8_t variant = action >> 5;
  if (which < 10)
    return act_on_line(which, variant);
  if (which < 22)
    return act_on_motion(which, variant);
  return act_on_world(which, variant);
}

void Script::act_on_line(uint8_t which, uint8_t variant) {
  switch (which) {
    case 0:
      return hello(variant);
    case 1:
      if (variant < 6)
        ++stop_number_;
      return send(protocol::Stop{variant == 7 ? input_.byte() : stop_number_});
    case 2:
      return send(protocol::Ping{input_.byte()});
    case 3:  // each record, by its id or a wrong one
    case 4: {
      const uint8_t record = variant & 3;
      const uint8_t id = record < protocol::kRecordCount
                             ? bench_.line().record_id(static_cast<protocol::Record>(record))
                             : 1;
      return send(protocol::Acknowledge{record, variant < 4 ? id : input_.byte()});
    }
    case 5:
      return send(protocol::Recall{static_cast<uint8_t>(variant & 3)});
    case 6:
      return send(protocol::ReadLimits{0});
    case 7:
      twist_ = static_cast<Twist>(variant);
      old_epoch_ = variant == 0;
      return;
    case 8:
      return raw(variant);
    default: {  // a frame of any type and length
      uint8_t inside[58];
      const size_t size = 1 + input_.byte() % sizeof(inside);
      for (size_t i = 0; i < size; ++i)
        inside[i] = input_.byte();
      uint8_t wire[kWireMax];
      return bench_.receive(wire, reference_seal(inside, size, wire));
    }
  }
}

void Script::act_on_motion(uint8_t which, uint8_t variant) {
  switch (which) {
    case 10:
      return enable(variant);
    case 11:
    case 12:
      return send(protocol::Resume{epoch()});
    case 13: {
      protocol::Relax message = {static_cast<uint16_t>(variant < 6 ? 8 << variant : input_.byte()),
                                 {kFree, kFree, kFree, kFree}};
      if ((variant & 1) != 0)
        pose(message.free_ticks);
      return send(message);
    }
    case 14:
      return send(protocol::Limp{0});
    case 15:
    case 16:
    case 17:
    case 18:
      return segments(variant);
    case 19:
      return guard(variant);
    case 20:
      if (variant > 5)
        return send(protocol::StoreLimits{0});
      return send(protocol::Disarm{0});
    default:
      return set_limits(variant);
  }
}

void Script::act_on_world(uint8_t which, uint8_t variant) {
  switch (which) {
    case 22:
    case 23:
      return run_frames(kWaits[variant]);
    case 25:  // pressure, in steps of 2 hPa
      bench_.pressure_raw = (1013 + 2 * static_cast<int8_t>(input_.byte())) * kHpa;
      return;
    case 26:
      bench_.pressure_raw = 1013 * kHpa;
      bench_.sensor = Sensor::kOk;
      bench_.sensor_silent = bench_.sensor_stuck = false;
      bench_.swing_raw = 0;
      bench_.machine.set_supply_mv(5000);
      return;
    case 27:
      if (variant < 5)
        bench_.sensor = static_cast<Sensor>(variant);
      if (variant == 5)
        bench_.sensor_stuck = true;
      if (variant == 6)
        bench_.sensor_silent = true;
      if (variant == 7)
        bench_.pressure_raw = (input_.byte() & 1) != 0 ? 259 * kHpa : 1261 * kHpa;
      return;
    case 28:
      return bench_.restart(static_cast<protocol::ResetCause>(variant % protocol::kResetCauseCount),
                            variant > 5);
    case 24:  // supply, stop switch, noise
      if (variant < 2)
        bench_.machine.set_supply_mv(variant == 0 ? 3500 : 5000);
      if (variant == 2 || variant == 3)
        bench_.machine.set_stop_switch(variant == 3);
      if (variant == 4)
        bench_.swing_raw = 8 * kHpa;
      if (variant > 4)
        bench_.run_us(10000u * (variant - 4u));
      return;
    case 29:
      return bench_.listen(!bench_.listening());
    case 30:
      return bench_.stall_us(kFrameUs / 4 * (1 + variant * variant));
    default:  // the next frame begins in the middle of what the board does next
      bench_.machine.begin_frame_at_call(1 + variant);
      return;
  }
}

void Script::hello(uint8_t variant) {
  protocol::Hello message = {protocol::kProtocolVersion, protocol::kSchemaHash, next_session_,
                             input_.byte()};
  switch (variant) {
    case 5:
      message.new_session = 0;
      break;
    case 6:
      message.new_session = bench_.board().session;
      break;
    case 7:
      (input_.byte() & 1) != 0 ? ++message.protocol_version : ++message.schema_hash;
      break;
    default:
      next_session_ = next_session_ == 255 ? 1 : next_session_ + 1;
      break;
  }
  send(message);
}

void Script::enable(uint8_t variant) {
  protocol::Enable message = {{kFree, kFree, kFree, kFree}};
  if (variant > 3)
    pose(message.pulse_ticks);
  memcpy(end_ticks_, message.pulse_ticks, sizeof(end_ticks_));
  send(message);
}

void Script::segments(uint8_t variant) {
  protocol::Segments message = {};
  message.epoch = epoch();
  message.count = variant < 5 ? variant + 1 : variant == 7 ? input_.byte() : 5;
  for (uint8_t i = 0; i < message.count && i < protocol::kSegmentsPerMessage; ++i) {
    protocol::Segment& segment = message.segments[i];
    if (i != 0 && variant > 4) {  // all alike, to fill the queue with few bytes
      segment = message.segments[0];
      continue;
    }
    pose(segment.target_ticks);
    segment.duration_frames = duration_frames(end_ticks_, segment.target_ticks);
    memcpy(end_ticks_, segment.target_ticks, sizeof(end_ticks_));
  }
  send(message);
}

void Script::guard(uint8_t variant) {
  protocol::GuardMessage message = {};
  message.epoch = epoch();
  message.threshold_raw = 15 * kHpa;
  message.consecutive = 2;
  message.deadline_frames = 1000;
  message.reflex = static_cast<uint8_t>((variant & 1) != 0 ? Reflex::kRetract : Reflex::kHold);
  for (uint16_t& ticks : message.retract_ticks)
    ticks = kFree + 100;
  message.retract_slew_ticks = 20;
  if ((variant & 2) != 0)
    message.deadline_frames = input_.byte();
  if ((variant & 4) != 0) {
    pose(message.retract_ticks);
    const uint8_t more = input_.byte();
    message.consecutive = more & 15;
    message.threshold_raw = (more >> 4) * 5 * kHpa;
    message.retract_slew_ticks = input_.byte();
    if (message.retract_slew_ticks > 250)
      message.reflex = 2;
  }
  send(message);
}

void Script::set_limits(uint8_t variant) {
  protocol::SetLimits message = kDefaultLimits;
  const uint8_t how = input_.byte();
  const uint8_t servo = how & 3;
  switch (variant) {
    case 0:
      break;
    case 1:
      message.hold_timeout_s = (how & 1) != 0;
      message.stop_switch = how >> 1 & 1;
      break;
    case 2:
      message.slew_ticks = how;
      break;
    case 3:
      message.pulse_max_ticks[servo] = 1600 + how * 10;
      break;
    case 4:
      message.pulse_min_ticks[servo] = 900 + how * 4;
      break;
    case 5:
      message.pair_sum_max_ticks[servo & 1] = 3300 + how * 8;
      break;
    case 6:
      message.pair_difference_max_ticks[servo & 1] = how * 4 - 500;
      break;
    default:
      message.coarse_threshold_raw = how * kHpa;
      break;
  }
  send(message);
}

void Script::raw(uint8_t variant) {
  uint8_t bytes[64];
  const size_t size = variant < 7 ? 1 + variant * 2 : 64;
  for (size_t i = 0; i < size; ++i)
    bytes[i] = input_.byte();
  bench_.receive(bytes, size);
}

void Script::run_frames(uint32_t frames) {
  if (frames > frames_left_)
    frames = frames_left_;
  frames_left_ -= frames;
  bench_.run_us(frames * kFrameUs);
}

uint8_t Script::epoch() {
  const uint8_t now = bench_.board().epoch;
  if (!old_epoch_)
    return now;
  old_epoch_ = false;
  return static_cast<uint8_t>(now - 1 - (input_.byte() & 3));
}

// Mostly one that is allowed.
void Script::pose(uint16_t* ticks) {
  const uint8_t height = input_.byte();
  const int bend = static_cast<int8_t>(input_.byte()) * 8;
  const uint16_t middle = height < 8 ? kOddTicks[height] : 1628 + 9 * height;
  ticks[0] = static_cast<uint16_t>(middle + bend / 2);
  ticks[2] = static_cast<uint16_t>(middle - bend / 2);
  ticks[1] = middle;
  ticks[3] = middle;
}

uint16_t Script::duration_frames(const uint16_t* from, const uint16_t* to) {
  const uint8_t how = input_.byte();
  const uint16_t fastest = static_cast<uint16_t>((longest_distance(from, to) + kSlew - 1) / kSlew);
  if (how < 32)
    return fastest + how;
  if (how < 250)
    return how / 4;
  constexpr uint16_t kOdd[] = {0, 1, 255, 256, 32767, 65535};
  return kOdd[how - 250];
}

template <typename Message>
void Script::send(const Message& message) {
  uint8_t inside[protocol::HostHeader::kSize + Message::kSize];
  protocol::HostHeader header = {static_cast<uint8_t>(Message::kType), bench_.board().session, 0};
  if (protocol::is_reliable(Message::kType))
    header.sequence = bench_.board().expected;
  switch (twist_) {
    case Twist::kForeignSession:
      ++header.session;
      break;
    case Twist::kNoSession:
      header.session = 0;
      break;
    case Twist::kOldSequence:
      --header.sequence;
      break;
    case Twist::kGapSequence:
      ++header.sequence;
      break;
    case Twist::kAnySequence:
      header.sequence = input_.byte();
      break;
    default:
      break;
  }
  encode(header, inside);
  encode(message, inside + protocol::HostHeader::kSize);
  send_inside(inside, sizeof(inside));
}

void Script::send_inside(const uint8_t* inside, size_t size) {
  uint8_t wire[kWireMax];
  size_t wire_size = reference_seal(inside, size, wire);
  if (twist_ == Twist::kFlippedBit) {
    const uint16_t where = input_.word();
    wire[(where >> 3) % wire_size] ^= static_cast<uint8_t>(1 << (where & 7));
  } else if (twist_ == Twist::kLostByte) {
    const size_t lost = input_.byte() % wire_size;
    memmove(wire + lost, wire + lost + 1, --wire_size - lost);
  }
  twist_ = Twist::kNone;
  bench_.receive(wire, wire_size);
}

}  // namespace fuzz
}  // namespace setae
