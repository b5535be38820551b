// What a target does when the code under test breaks a promise: say which, and die, so that the
// fuzzer keeps the input.
#pragma once

#include <stdio.h>
#include <stdlib.h>

namespace setae {
namespace fuzz {

[[noreturn]] inline void violated(const char* promise) {
  fprintf(stderr, "violated: %s\n", promise);
  abort();
}

inline void expect(bool kept, const char* promise) {
  if (!kept)
    violated(promise);
}

}  // namespace fuzz
}  // namespace setae
