// Target: the whole board, played with as the input says, watched at every step.
#include "bench.h"
#include "script.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace setae::fuzz;
  Bench bench;
  Input input(data, size);
  Script(bench, input).play();
  return 0;
}
