#include "world.h"

#include <algorithm>
#include <cmath>

namespace setae {
namespace sim {
namespace {

// Samples in a row without a solution that end a run. One alone can be a snap
// from one equilibrium to another; all are counted.
constexpr int kUnsolvedMost = 10;
constexpr uint64_t kSlipStream = 16;  // of random numbers; the bristle has those before

Body make_body(const Parameters& p, uint64_t seed) {
  Body body{{}, Plant(plant_settings(p))};
  PerTendon lengths_mm{};
  for (int i = 0; i < kTendons; ++i) {
    body.servos.emplace_back(servo_settings(p, i), Random(seed, kSlipStream + i));
    lengths_mm[i] = body.servos[i].length_mm();
  }
  body.plant.settle(lengths_mm);
  return body;
}

int64_t sample_time_us(const Parameters& p, int64_t number) {
  const double rate_hz = p.sensor.rate_hz * (1 + p.sensor.rate_error);
  return std::llround(1e6 * static_cast<double>(number) / rate_hz);
}

}  // namespace

World::World(const Parameters& parameters, const Environment& environment, uint64_t seed,
             const Vec3& arm_mm, ForeignPlant foreign)
    : parameters_(parameters),
      environment_(environment),
      clock_error_ppb_(std::llround(1000 * parameters.board.clock_rate_ppm)),
      line_(line_settings(parameters)),
      body_(make_body(parameters, seed)),
      foreign_(std::move(foreign)),
      bristle_(bristle_settings(parameters), seed),
      next_sample_us_(sample_time_us(parameters, 1)) {
  arm_.place(arm_mm);
  ask_foreign();
  const Top start = top(body_);
  bristle_.place(in_world(root_mm(start)), in_world(start.rotation));
  if (parameters.board.pose_known == 0)
    hal_.forget_pose();
  boot();
}

Outcome World::run(int64_t until_us) {
  while (!line_.host_has_bytes() && now_us_ < until_us) {
    // The board runs at events only, so that nothing depends on how a caller
    // slices the time.
    const int64_t next_us = next_event_us();
    now_us_ = std::min(next_us, until_us);
    if (next_us <= now_us_)
      handle_events();
    if (outcome() == Outcome::kForeignFailed || unsolved_ >= kUnsolvedMost)
      return outcome();
  }
  return Outcome::kFine;
}

Outcome World::outcome() const {
  if (foreign_)
    return foreign_failed_ ? Outcome::kForeignFailed : Outcome::kFine;
  return body_.plant.solved() ? Outcome::kFine : Outcome::kNoSolution;
}

int64_t World::next_event_us() const {
  int64_t next_us = std::min({next_sample_us_, line_.next_arrival_us(), line_.next_transmitted_us(),
                              line_.next_flush_us()});
  if (!board_)
    return std::min(next_us, boot_us_);
  return std::min({next_us, next_frame_us_, next_poll_us_});
}

void World::handle_events() {
  bool poll = boot();
  if (board_)
    hal_.advance_to(static_cast<uint64_t>(board_us(now_us_)));
  poll |= start_frame();
  poll |= sample();
  poll |= receive();
  if (line_.next_transmitted_us() <= now_us_) {
    line_.finish_transmit();
    poll = true;
  }
  if (next_poll_us_ <= now_us_) {
    next_poll_us_ += std::llround(parameters_.board.poll_us);
    poll = true;
  }
  if (board_ && poll)
    board_->poll();
  transmit();
  if (line_.next_flush_us() <= now_us_)
    line_.flush();
}

int64_t World::board_us(int64_t world_us) const {
  const int64_t elapsed_us = world_us - boot_us_;
  return elapsed_us + elapsed_us * clock_error_ppb_ / 1000000000;
}

int64_t World::world_us(int64_t board_us_wanted) const {
  int64_t time_us = boot_us_ + static_cast<int64_t>(static_cast<double>(board_us_wanted) /
                                                    (1 + 1e-9 * clock_error_ppb_));
  while (board_us(time_us) >= board_us_wanted)
    --time_us;
  while (board_us(time_us) < board_us_wanted)
    ++time_us;
  return time_us;
}

bool World::boot() {
  if (board_ || now_us_ < boot_us_)
    return false;
  board_ = std::make_unique<Board>(hal_);
  frame_ = 1;
  next_frame_us_ = world_us(protocol::kServoFrameUs);
  next_poll_us_ = now_us_;
  return true;
}

void World::reset_board() {
  board_.reset();
  hal_.restart(protocol::ResetCause::kExternal);
  line_.abort_transmit();
  boot_us_ = now_us_ + std::llround(parameters_.board.boot_us);
  next_frame_us_ = kNever;
  next_poll_us_ = kNever;
  for (Servo& servo : body_.servos) {
    servo.advance_to(now_us_);
    servo.detach();
  }
}

void World::remove_board() {
  reset_board();
  boot_us_ = kNever;
  next_sample_us_ = kNever;
  outside_ = true;
}

void World::pulse(int servo, double width_us) {
  outside_us_[servo] = width_us;
  Servo& driven = body_.servos[servo];
  driven.advance_to(now_us_);
  if (width_us > 0) {
    driven.pulse(now_us_, width_us);
  } else {
    driven.detach();
  }
}

Outcome World::sense() {
  next_sample_us_ = now_us_;
  sample();
  next_sample_us_ = kNever;
  return unsolved_ >= kUnsolvedMost || foreign_failed_ ? outcome() : Outcome::kFine;
}

bool World::start_frame() {
  if (!board_ || next_frame_us_ > now_us_)
    return false;
  for (int i = 0; i < kTendons; ++i) {
    Servo& servo = body_.servos[i];
    servo.advance_to(now_us_);
    if ((hal_.attached() >> i & 1) == 0) {
      servo.detach();
      continue;
    }
    // The servo's own clock is right: a board that runs fast sends short pulses.
    const double width_us = static_cast<double>(hal_.output().ticks[i]) /
                            protocol::kPulseTicksPerUs / (1 + 1e-9 * clock_error_ppb_);
    servo.pulse(now_us_ + std::llround(width_us), width_us);
  }
  ++frame_;
  next_frame_us_ = world_us(frame_ * protocol::kServoFrameUs);
  return true;
}

bool World::receive() {
  bool received = false;
  while (line_.next_arrival_us() <= now_us_) {
    const uint8_t byte = line_.take_arrival();
    if (!board_)
      continue;  // nobody listens while it boots
    hal_.push_rx(byte);
    received = true;
  }
  return received;
}

void World::transmit() {
  uint8_t byte;
  if (board_ && line_.transmitter_free() && hal_.pop_tx(byte))
    line_.transmit(now_us_, byte);
}

bool World::sample() {
  if (next_sample_us_ > now_us_)
    return false;
  const int64_t duration_us = now_us_ - last_sample_us_;
  move(body_, duration_us);
  ask_foreign();
  count_unsolved();
  const Top now = top(body_);
  bristle_.step(1e-6 * static_cast<double>(duration_us), in_world(root_mm(now)),
                in_world(now.rotation), environment_);
  last_sample_us_ = now_us_;
  ++samples_;
  next_sample_us_ = sample_time_us(parameters_, samples_ + 1);

  if (!board_)
    return false;
  push_sample();
  return true;
}

void World::count_unsolved() {
  const bool fine = outcome() == Outcome::kFine;
  unsolved_ = fine ? 0 : unsolved_ + 1;
  if (foreign_)
    return;
  unsolved_samples_ += fine ? 0 : 1;
  largest_residual_ = std::max(largest_residual_, body_.plant.residual());
}

void World::push_sample() {
  constexpr double kNoiseHpa = 10;
  protocol::Sensor status = protocol::Sensor::kOk;
  double hpa = pressure_hpa();
  switch (sensor_fault_) {
    case SensorFault::kSilent:
      return;
    case SensorFault::kAbsent:
      status = protocol::Sensor::kAbsent;
      break;
    case SensorFault::kBus:
      status = protocol::Sensor::kBus;
      break;
    case SensorFault::kWrong:
      status = protocol::Sensor::kWrong;
      break;
    case SensorFault::kRange:
      hpa = 0;
      break;
    case SensorFault::kNoisy:
      hpa += samples_ % 2 ? kNoiseHpa : -kNoiseHpa;
      break;
    default:
      break;
  }
  int32_t raw = static_cast<int32_t>(std::lround(protocol::kPressureLsbPerHpa * hpa));
  // The part's own noise moves the last bits, whatever the pressure does.
  if (raw == last_raw_)
    raw ^= 1;
  if (sensor_fault_ != SensorFault::kStuck)
    last_raw_ = raw;
  hal_.push_sample(status, last_raw_, hal_.board_us());
}

// Brings servos and spring to the present time, the spring from `duration_us` ago.
void World::move(Body& body, int64_t duration_us) const {
  PerTendon lengths_mm{};
  for (int i = 0; i < kTendons; ++i) {
    body.servos[i].advance_to(now_us_);
    lengths_mm[i] = body.servos[i].length_mm();
  }
  if (duration_us <= 0 || foreign_)
    return;
  if (lengths_mm == body.plant.lengths_mm() && !body.plant.creeping() && body.plant.solved()) {
    return;
  }
  body.plant.step(lengths_mm, 1e-6 * static_cast<double>(duration_us));
}

void World::ask_foreign() {
  if (!foreign_)
    return;
  Drive drive{now_us_, attached(), {}, {}};
  for (int i = 0; i < kTendons; ++i) {
    drive.pulse_us[i] = pulse_us(i);
    drive.pull_mm[i] = parameters_.spring.free_length_mm - body_.servos[i].length_mm();
  }
  foreign_failed_ = !foreign_(drive, answer_);
}

uint32_t World::attached() const {
  if (!outside_)
    return hal_.attached();
  uint32_t bits = 0;
  for (int i = 0; i < kTendons; ++i)
    bits |= outside_us_[i] > 0 ? 1u << i : 0u;
  return bits;
}

double World::pulse_us(int tendon) const {
  if (outside_)
    return outside_us_[tendon];
  if ((hal_.attached() >> tendon & 1) == 0)
    return 0;
  return static_cast<double>(hal_.output().ticks[tendon]) / protocol::kPulseTicksPerUs;
}

double World::pressure_hpa() const {
  const bool theirs = foreign_ && std::isfinite(answer_.pressure_hpa);
  return parameters_.sensor.ambient_hpa + (theirs ? answer_.pressure_hpa : bristle_.pressure_hpa());
}

Top World::top(const Body& body) const {
  if (foreign_)
    return answer_.top;
  const Shape& shape = body.plant.shape();
  return {shape.position[shape.elements], shape.rotation[shape.elements], body.plant.tension_n()};
}

Vec3 World::root_mm(const Top& top) const {
  const Parameters::Bristle& bristle = parameters_.bristle;
  return top.position_mm + (bristle.tip_offset_mm - bristle.filament_length_mm) * top.rotation.ez;
}

Truth World::truth() const {
  Truth truth{body_, {}, {}, {}, {}, bristle_.filament().tip_mm()};
  move(truth.body, now_us_ - last_sample_us_);
  truth.top = top(truth.body);
  truth.root_mm = root_mm(truth.top);
  truth.tip_mm = truth.root_mm + parameters_.bristle.filament_length_mm * truth.top.rotation.ez;
  truth.contact = environment_.deepest(in_world(truth.root_mm), in_world(truth.tip_mm));
  return truth;
}

}  // namespace sim
}  // namespace setae
