// The UNO: wiring and loop, nothing else.
//
//   D9, D10, D11, D3   servos of tendons 0 to 3
//   A4 (SDA), A5 (SCL) pressure sensor, through a level shifter
//   D4                 stop switch to ground, normally closed (optional)
//   D0, D1 (USB)       the host
#include <avr/interrupt.h>

#include "board/board.h"
#include "hal_uno/uno_hal.h"

namespace {

setae::Hal hal;
setae::Board board(hal);

}  // namespace

// The Arduino core's own main() would start a timer, its interrupt and the ADC first.
int main() {
  setae::uno::begin();
  sei();
  for (;;) {
    board.poll();
    setae::uno::service();
  }
}
