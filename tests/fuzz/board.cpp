// Target: the whole board, played with as the input says, watched at every step.
#include <stdio.h>
#include <stdlib.h>

#include "bench.h"
#include "script.h"

namespace {

// At the end of a run, on request: what all its inputs together have met.
struct Summary {
  ~Summary() {
    if (getenv("SETAE_REACHED") == nullptr)
      return;
    print("mode", setae::fuzz::reached.mode, setae::kModeCount);
    print("fault", setae::fuzz::reached.fault, 256);
    print("refusal", setae::fuzz::reached.refusal, 256);
    print("trip", setae::fuzz::reached.trip_cause, 256);
  }
  static void print(const char* name, const bool* met, int count) {
    fputs(name, stdout);
    for (int i = 0; i < count; ++i) {
      if (met[i])
        printf(" %d", i);
    }
    putchar('\n');
  }
} summary;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace setae::fuzz;
  Bench bench;
  Input input(data, size);
  Script(bench, input).play();
  return 0;
}
