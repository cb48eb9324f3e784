// libFuzzer's entry (see tests/CMakeLists.txt for how to configure); then for instance
//   build/fuzz/tests/format_fuzz --write-corpus corpus
//   build/fuzz/tests/format_fuzz -max_total_time=60 corpus
// system_format_fuzz_test, an ordinary test, runs the same target over the corpus and its mutations.
#include "tests/fuzz/format_fuzz.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc != 3 || std::strcmp((*argv)[1], "--write-corpus") != 0) return 0;
  std::filesystem::create_directories((*argv)[2]);
  int number = 0;
  for (const auto& input : texmesh::fuzz::make_corpus())
    std::ofstream(std::filesystem::path((*argv)[2]) / std::to_string(number++), std::ios::binary)
        .write(reinterpret_cast<const char*>(input.data()), static_cast<std::streamsize>(input.size()));
  std::exit(0);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  texmesh::fuzz::read_format({data, size});
  return 0;
}
