// One world: board, line, servos, spring, bristle, arm and solids in one virtual
// time. Holds no state outside itself, so that many worlds can live side by side.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>
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

namespace setae {
namespace sim {

enum class SensorFault { kNone, kAbsent, kSilent, kBus };

// All that moves; copied where the world must be looked at between two steps.
struct Body {
  std::vector<Servo> servos;
  Plant plant;
};

struct Truth {
  Body body;
  Vec3 root_mm, tip_mm;  // of the filament, frame D
  Contact contact;       // in the world
};

class World {
 public:
  World(const Parameters& parameters, const Environment& environment, uint64_t seed,
        const Vec3& arm_mm);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  int64_t now_us() const { return now_us_; }
  void send(const uint8_t* data, size_t size) { line_.send(now_us_, data, size); }

  // Steps until the host can read bytes, or the time has come. False where the
  // plant has no solution any more.
  bool run(int64_t until_us);
  size_t read(uint8_t* data, size_t room) { return line_.read(data, room); }

  Arm& arm() { return arm_; }
  const Arm& arm() const { return arm_; }
  const HostHal& hal() const { return hal_; }
  double pressure_hpa() const { return parameters_.sensor.ambient_hpa + bristle_.pressure_hpa(); }

  Truth truth() const;
  bool solved() const { return body_.plant.solved(); }

  void set_sensor_fault(SensorFault fault) { sensor_fault_ = fault; }
  void reset_board();

 private:
  int64_t board_us(int64_t world_us) const;  // on the board's own clock
  int64_t world_us(int64_t board_us) const;  // when that clock gets there
  int64_t next_event_us() const;
  void handle_events();
  bool boot();
  bool receive();
  bool start_frame();
  bool sample();
  void move(Body& body, int64_t duration_us) const;
  void transmit();
  void filament(const Body& body, Vec3& root_mm, Vec3& tip_mm) const;
  Vec3 in_world(const Vec3& point_mm) const { return arm_.position_mm(now_us_) + flip(point_mm); }

  const Parameters parameters_;
  const Environment environment_;
  int64_t now_us_ = 0;

  HostHal hal_;
  std::unique_ptr<Board> board_;  // none while it boots
  int64_t clock_error_ppb_;
  int64_t boot_us_ = 0;  // when the board's time started, or will
  int64_t frame_ = 0;
  int64_t next_frame_us_ = kNever;
  int64_t next_poll_us_ = 0;

  Line line_;
  Arm arm_;
  Body body_;
  Bristle bristle_;
  SensorFault sensor_fault_ = SensorFault::kNone;
  int64_t samples_ = 0;
  int64_t last_sample_us_ = 0;
  int64_t next_sample_us_;
  int unsolved_ = 0;
};

}  // namespace sim
}  // namespace setae
