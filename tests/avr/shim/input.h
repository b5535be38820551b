// The inputs: D2 (PD2), with the external interrupt INT0 at its edges, and D4 (PD4). Data sheet
// sections 13 and 14. The interrupt at a low level is not modelled.
#pragma once

#include "chip.h"

namespace setae {
namespace uno {

class Input {
 public:
  explicit Input(Chip& chip);
  void reset();

  // The stop switch between D4 and ground; open where there is none.
  void set_switch_closed(bool closed) { switch_closed_ = closed; }
  // Whether something drives D2. Otherwise only the pull-up does, where that is on.
  void set_wired(bool wired);
  void drive(bool level);

 private:
  void look();
  bool level() const;

  Chip& chip_;
  avr_int_vector_t& vector_;
  bool switch_closed_ = false;
  bool wired_ = false;
  bool driven_ = false;
  bool before_ = false;
};

}  // namespace uno
}  // namespace setae
