// States, sessions, numbers and queue: what one poll may have changed.
#pragma once

#include "step.h"

namespace setae {
namespace fuzz {

class StateWatch {
 public:
  void on_restart() { *this = StateWatch(); }
  void on_step(const Step& step);

 private:
  static void check_link(const Step& step);
  static void check_queue(const Step& step);
  static void check_limits(const Step& step);
  static void check_modes(const Step& step);
  static void check_untouched(const Step& step);
};

}  // namespace fuzz
}  // namespace setae
