// libFuzzer's entry to the targets of a room; tests/fuzz/run drives it. The environment variable
// TEXMESH_FUZZ_TARGET names the target.
//   texmesh_fuzz_ROOM --list                  a line per target: name, runs that are wanted, most bytes
//   texmesh_fuzz_ROOM --seeds FOLDER          writes the target's seeds, known troublemakers and dictionary
//   (FOLDER.dict)
#include <sanitizer/allocator_interface.h>
#include <sys/time.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/mutator_module.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

namespace texmesh::fuzz {
namespace {

constexpr std::size_t kSmallInput = 100'000;
constexpr int kMostSeconds = 4;  // sanitizers and counters at -O1 make of one second about four
constexpr std::int64_t kMostHeapBytes = 256 << 20;  // that a small input may make a reader take

std::atomic<std::int64_t> heap_bytes{0};
std::atomic<bool> watched{false};

void count_new(const volatile void* p, std::size_t bytes) {
  if (!p) return;
  const std::int64_t sum = heap_bytes += static_cast<std::int64_t>(bytes);
  if (watched && sum > kMostHeapBytes) {
    watched = false;
    require(false, "more than 256 MB in use");
  }
}
void count_gone(const volatile void* p) {
  if (p) heap_bytes -= static_cast<std::int64_t>(__sanitizer_get_allocated_size(const_cast<const void*>(p)));
}

/// libFuzzer's own limit goes by the clock on the wall, which means nothing on a machine with other work.
void limit_processor_time(int seconds) {
  const itimerval limit{{0, 0}, {seconds, 0}};
  ::setitimer(ITIMER_PROF, &limit, nullptr);
}
void end_slow_run(int) { require(false, "more than four seconds of processor time"); }

const Target& chosen_target() {
  static const Target* target = [] {
    const char* name = std::getenv("TEXMESH_FUZZ_TARGET");
    const Target* t = name ? find_target(name) : nullptr;
    if (!t)
      std::fprintf(stderr, "TEXMESH_FUZZ_TARGET is %s; --list names the targets\n", name ? name : "not set");
    if (!t) std::exit(2);
    return t;
  }();
  return *target;
}

void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// As libFuzzer reads it: "..." with everything but letters and digits as \xNN.
std::string dictionary(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += '"';
    for (const char c : word) {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      text += std::isalnum(static_cast<unsigned char>(c)) ? std::string(1, c) : escaped;
    }
    text += "\"\n";
  }
  return text;
}

void write_seeds(const std::string& folder) {
  const Target& target = chosen_target();
  std::filesystem::create_directories(folder);
  int number = 0;
  for (const auto& list : {target.seeds(), regressions(target.name)})
    for (const Bytes& seed : list)
      write_file(std::filesystem::path(folder) / ("seed" + std::to_string(number++)), seed);
  write_file(folder + ".dict", to_bytes(dictionary(target.words)));
}

/// Twice the largest seed: time goes by bytes, and what is longer says little that is new.
std::size_t most_bytes(const Target& target) {
  std::size_t largest = 0;
  for (const Bytes& seed : target.seeds()) largest = std::max(largest, seed.size());
  return std::clamp<std::size_t>(2 * largest, 512, 8192);
}

}  // namespace
}  // namespace texmesh::fuzz

using namespace texmesh::fuzz;

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc == 2 && std::strcmp((*argv)[1], "--list") == 0) {
    for (const Target& t : targets())
      std::printf("%s\t%d\t%zu\n", t.name, t.own ? 10'000'000 : 1'000'000, most_bytes(t));
    std::exit(0);
  }
  if (*argc == 3 && std::strcmp((*argv)[1], "--seeds") == 0) {
    write_seeds((*argv)[2]);
    std::exit(0);
  }
  chosen_target();
  __sanitizer_install_malloc_and_free_hooks(count_new, count_gone);
  std::signal(SIGPROF, end_slow_run);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  heap_bytes = 0;
  watched = size < kSmallInput;
  limit_processor_time(kMostSeconds);
  chosen_target().run({data, size});
  limit_processor_time(0);
  watched = false;
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  static texmesh::Bytes mutated;
  const Target& target = chosen_target();
  if (target.shape == Shape::kBytes) {
    const std::size_t changed = LLVMFuzzerMutate(data, size, most);
    if (!target.mend || seed % 8 == 0) return changed;
    mutated = target.mend({data, changed});
    std::memcpy(data, mutated.data(), std::min(mutated.size(), most));
    return std::min(mutated.size(), most);
  }
  const auto take = [](const std::uint8_t* bytes, std::size_t count) {
    mutated.assign(bytes, bytes + count);
  };
  texmesh_fuzz_mutate(&target, data, size, seed, LLVMFuzzerMutate, take);
  if (mutated.size() > most) return LLVMFuzzerMutate(data, size, most);
  std::memcpy(data, mutated.data(), mutated.size());
  return mutated.size();
}
