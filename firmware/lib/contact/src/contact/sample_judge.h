// Whether a pressure sample can be believed, by its value and those before it.
#pragma once

#include <stdint.h>

#include "protocol/messages.h"

namespace setae {

class SampleJudge {
 public:
  // ok, range, stuck or noisy.
  protocol::Sensor take(int32_t raw);

 private:
  int32_t last_raw_ = 0;
  uint8_t same_ = 0;   // samples in a row that equal the one before
  uint8_t turns_ = 0;  // rises with each jump right back, falls with each sample without
  int8_t jump_ = 0;    // up, none or down, by the last sample
  bool noisy_ = false;
};

}  // namespace setae
