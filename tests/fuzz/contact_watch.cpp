#include "contact_watch.h"

#include <stdlib.h>

#include "violation.h"

namespace setae {
namespace fuzz {

using protocol::Guard;

void ContactWatch::on_step(const Step& step) {
  ticks_ += step.frame_began;
  if (step.reading.fresh)
    sampled_frame_ = step.after.frame;
  if (step.guards()) {
    const auto message = step.read<protocol::GuardMessage>();
    threshold_raw_ = message.threshold_raw;
    consecutive_ = message.consecutive;
    deadline_frames_ = message.deadline_frames;
  }
  touched_ = false;
  if (step.before.guard == Guard::kArmed && step.reading.fresh) {
    const int32_t change_raw = abs(step.reading.pressure_raw - step.before.baseline_raw);
    crossed_ = static_cast<uint32_t>(change_raw) >= threshold_raw_ ? crossed_ + 1 : 0;
    touched_ = crossed_ >= consecutive_;
    expect(!touched_ || step.after.guard != Guard::kArmed, "an armed guard sees every contact");
    if (touched_)
      expect(is_latched(step.after.mode) || step.after.mode == Mode::kRelaxed,
             "a contact freezes the robot");
  }
  if (step.after.guard != Guard::kArmed)
    return;
  if (step.before.guard != Guard::kArmed) {
    armed_tick_ = ticks_;
    crossed_ = 0;
  }
  expect(step.reading.status == protocol::Sensor::kOk, "no guard is armed without a sensor");
  expect(step.after.frame - sampled_frame_ <= protocol::kSensorSilentFrames,
         "no guard is armed while the sensor is silent");
  expect(ticks_ - armed_tick_ <= deadline_frames_, "a guarded move ends at its deadline");
  expect(step.after.mode == Mode::kHolding || step.after.mode == Mode::kPlaying,
         "only a hold or a motion is guarded");
}

}  // namespace fuzz
}  // namespace setae
