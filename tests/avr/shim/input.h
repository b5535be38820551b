// D2 (PD2), an input with the external interrupt INT0 at its edges. Data sheet section 13. The
// interrupt at a low level is not modelled.
#pragma once

#include "chip.h"

namespace setae {
namespace uno {

class Input {
 public:
  explicit Input(Chip& chip);
  void reset();

  // What is wired to it. Otherwise only the pull-up, where that is on.
  void set_wired(bool wired);
  void drive(bool level);

 private:
  void look();
  bool level() const;

  Chip& chip_;
  avr_int_vector_t& vector_;
  bool wired_ = false;
  bool driven_ = false;
  bool before_ = false;
};

}  // namespace uno
}  // namespace setae
