// The ADC with its reference at AVCC: the bandgap against the supply. Data sheet section 24: 13 ADC
// clocks a conversion, 25 the first one, ADIF and its interrupt; section 29.5, start-up time of the
// bandgap.
#pragma once

#include "chip.h"

namespace setae {
namespace uno {

class Adc {
 public:
  explicit Adc(Chip& chip);
  void reset();
  void set_supply(double volts) { supply_v_ = volts; }
  // 1.0 to 1.2 from chip to chip.
  void set_bandgap(double volts) { bandgap_v_ = volts; }

 private:
  void write_control(uint8_t value);
  void done();
  uint16_t convert() const;

  Chip& chip_;
  Alarm alarm_;
  double supply_v_ = 5.0;
  double bandgap_v_ = 1.1;
  bool first_ = true;  // since it was switched on
  Cycle selected_at_ = 0;
};

}  // namespace uno
}  // namespace setae
