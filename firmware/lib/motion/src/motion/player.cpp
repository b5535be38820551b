#include "motion/player.h"

namespace setae {

void Player::clear() {
  queue_.clear();
  line_.cancel();
  playing_ = false;
}

bool Player::step(Pulses& pulses) {
  if (playing_ && !line_.running()) {
    queue_.pop();
    playing_ = false;
  }
  if (!playing_) {
    if (queue_.empty())
      return false;
    line_.start(pulses, queue_.front().target_ticks, queue_.front().duration_frames);
    playing_ = true;
  }
  line_.step(pulses);
  return true;
}

}  // namespace setae
