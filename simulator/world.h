// One world: board, line, servos, spring, bristle, arm and solids in one virtual
// time. Holds no state outside itself, so that many worlds can live side by side.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "arm.h"
#include "board/board.h"
#include "bristle.h"
#include "environment.h"
#include "hal_host/host_hal.h"
#include "line.h"
#include "parameters.h"
#include "plant.h"
#include "servo.h"
#include "settings.h"

namespace setae {
namespace sim {

enum class SensorFault { kNone, kAbsent, kSilent, kBus, kWrong, kStuck, kRange, kNoisy };
constexpr int kSensorFaults = 8;

// All that moves; copied where the world must be looked at between two steps.
struct Body {
  std::vector<Servo> servos;
  Plant plant;
};

// Where the spring's top is, and what pulls it.
struct Top {
  Vec3 position_mm;
  Mat3 rotation;
  PerTendon tension_n;
};

// Another plant in the place of the spring: asked at every sample for the answer to
// what the servos do. Not a finite pressure: the world's own bristle says it.
struct Drive {
  int64_t time_us;
  unsigned attached;
  std::array<double, kTendons> pulse_us, pull_mm;
};
struct Answer {
  Top top;
  double pressure_hpa;
};
using ForeignPlant = std::function<bool(const Drive&, Answer&)>;

enum class Outcome { kFine, kNoSolution, kForeignFailed };

struct Truth {
  Body body;
  Top top;
  Vec3 root_mm, tip_mm;  // of the undeformed filament, frame D
  Contact contact;       // of that, in the world
  Vec3 bent_tip_mm;      // of the filament at the last sample, in the world
};

class World {
 public:
  // `foreign` may be empty: then the spring is the plant.
  World(const Parameters& parameters, const Environment& environment, uint64_t seed,
        const Vec3& arm_mm, ForeignPlant foreign);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  int64_t now_us() const { return now_us_; }
  void send(const uint8_t* data, size_t size) { line_.send(now_us_, data, size); }

  // Steps until the host can read bytes, or the time has come.
  Outcome run(int64_t until_us);
  size_t read(uint8_t* data, size_t room) { return line_.read(data, room); }

  Arm& arm() { return arm_; }
  const Arm& arm() const { return arm_; }
  const HostHal& hal() const { return hal_; }
  double pressure_hpa() const;

  Truth truth() const;
  bool foreign() const { return static_cast<bool>(foreign_); }
  // Of the first equilibrium, right after it was made.
  Outcome outcome() const;
  // Of the spring at all samples so far: how near its worst is to a solution, how many have none.
  double largest_residual() const { return largest_residual_; }
  int64_t unsolved_samples() const { return unsolved_samples_; }

  void set_sensor_fault(SensorFault fault) { sensor_fault_ = fault; }
  void set_supply_mv(uint16_t supply_mv) { hal_.set_supply_mv(supply_mv); }
  void set_stop_switch(bool open) { hal_.set_stop_switch(open); }
  void reset_board();

  // For a board outside of this world, which is in step with it: there is none inside any more.
  void remove_board();
  // Its pulse for a servo has just ended; 0: there are no pulses any more.
  void pulse(int servo, double width_us);
  // Its sensor takes a sample now.
  Outcome sense();

  // Bit i: servo i has pulses; and how wide they are, 0 where there are none.
  uint32_t attached() const;
  double pulse_us(int tendon) const;

 private:
  int64_t board_us(int64_t world_us) const;  // on the board's own clock
  int64_t world_us(int64_t board_us) const;  // when that clock gets there
  int64_t next_event_us() const;
  void handle_events();
  bool boot();
  bool receive();
  bool start_frame();
  bool sample();
  void count_unsolved();
  void push_sample();
  void move(Body& body, int64_t duration_us) const;
  void transmit();
  void ask_foreign();
  Top top(const Body& body) const;
  Vec3 root_mm(const Top& top) const;  // of the filament
  Vec3 in_world(const Vec3& point_mm) const { return arm_.position_mm(now_us_) + flip(point_mm); }
  static Mat3 in_world(const Mat3& axes) { return {flip(axes.ex), flip(axes.ey), flip(axes.ez)}; }

  const Parameters parameters_;
  const Environment environment_;
  int64_t now_us_ = 0;

  HostHal hal_;
  std::unique_ptr<Board> board_;  // none while it boots
  bool outside_ = false;          // the board is
  std::array<double, kTendons> outside_us_{};
  int64_t clock_error_ppb_;
  int64_t boot_us_ = 0;  // when the board's time started, or will
  int64_t frame_ = 0;
  int64_t next_frame_us_ = kNever;
  int64_t next_poll_us_ = 0;

  Line line_;
  Arm arm_;
  Body body_;
  ForeignPlant foreign_;
  Answer answer_{};
  bool foreign_failed_ = false;
  Bristle bristle_;
  SensorFault sensor_fault_ = SensorFault::kNone;
  int64_t samples_ = 0;
  int32_t last_raw_ = 0;
  int64_t last_sample_us_ = 0;
  int64_t next_sample_us_;
  int unsolved_ = 0;  // samples in a row
  int64_t unsolved_samples_ = 0;
  double largest_residual_ = 0;
};

}  // namespace sim
}  // namespace setae
