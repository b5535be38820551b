// The four servo pins: D9 (PB1), D10 (PB2), D11 (PB3) and D3 (PD3), with pull-downs on the lines.
#pragma once

#include <vector>

#include "chip.h"
#include "timers.h"

namespace setae {
namespace uno {

constexpr int kServoPins = 4;

struct Edge {
  Cycle cycle;
  uint8_t servo;
  uint8_t level;
};

class Pins {
 public:
  explicit Pins(Chip& chip);
  void reset();
  std::vector<Edge>& edges() { return edges_; }
  const Timer& timer0() const { return timer0_; }
  const Timer& timer1() const { return timer1_; }
  const Timer& timer2() const { return timer2_; }

 private:
  void look(Cycle when);

  Chip& chip_;
  Timer timer0_;  // its outputs, D5 and D6, go nowhere
  Timer timer1_;
  Timer timer2_;
  bool levels_[kServoPins] = {};
  std::vector<Edge> edges_;
};

}  // namespace uno
}  // namespace setae
