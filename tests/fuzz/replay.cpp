// Runs a target over files, each an input, without a fuzzer: for coverage, and for planted bugs.
#include <stdint.h>
#include <stdio.h>

#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

int main(int count, char** names) {
  for (int i = 1; i < count; ++i) {
    FILE* file = fopen(names[i], "rb");
    if (file == nullptr) {
      perror(names[i]);
      return 2;
    }
    std::vector<uint8_t> data;
    for (int byte = fgetc(file); byte != EOF; byte = fgetc(file))
      data.push_back(static_cast<uint8_t>(byte));
    fclose(file);
    LLVMFuzzerTestOneInput(data.data(), data.size());
  }
  return 0;
}
