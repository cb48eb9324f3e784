#pragma once
// What is fuzzed: every reader of bytes that somebody else may have written. fuzz_main.cpp hands the targets
// to libFuzzer; tests/system/fuzz_replay_test.cpp runs them over seeds, known troublemakers and mutations.
#include <exception>
#include <string>
#include <vector>

#include "format/base/bytes.h"

namespace texmesh::fuzz {

/// How a mutation keeps an input whole enough to be read beyond its first bytes.
enum class Shape : std::uint8_t {
  kBytes,
  kJson,       // a value somewhere in the document changes
  kGlb,        // JSON or binary chunk change, lengths follow
  kContainer,  // an entry changes; CRCs, digests and places follow
};

struct Target {
  const char* name;
  bool own;  // reads a binary format of ours: ten times the runs
  /// Whether the bytes were accepted. Anything but an answer, or the reader's own error, is a fault: it
  /// aborts. So does an answer that breaks what the reader promises.
  bool (*run)(ByteSpan input);
  /// Inputs that are accepted, made by code.
  std::vector<Bytes> (*seeds)();
  Shape shape = Shape::kBytes;
  /// Puts digests and lengths right; null where there are none.
  Bytes (*mend)(ByteSpan input) = nullptr;
  /// What the format's texts are made of.
  std::vector<std::string> words = {};
};

/// All of them, by room.
const std::vector<Target>& targets();
/// Null for a name that is none.
const Target* find_target(const std::string& name);

/// Inputs that once made a target crash, hang or take too much memory: they must stay harmless.
std::vector<Bytes> regressions(const std::string& target);

/// Aborts, with the sentence, unless `good`.
void require(bool good, const char* what);

/// False; with TEXMESH_FUZZ_SAY in the environment says why.
bool refused(const std::exception& why);

inline Bytes to_bytes(std::string_view text) { return {text.begin(), text.end()}; }

/// Reads the head of an input as numbers, zeros behind its end.
class Choices {
 public:
  explicit Choices(ByteSpan bytes) : bytes_(bytes) {}
  std::uint32_t number(int width) {
    std::uint32_t n = 0;
    for (int i = 0; i < width && at_ < bytes_.size(); ++i) n |= std::uint32_t{bytes_[at_++]} << 8 * i;
    return n;
  }
  std::uint32_t below(std::uint32_t count) { return number(1) % count; }
  ByteSpan rest() const { return bytes_.subspan(at_); }

 private:
  ByteSpan bytes_;
  std::size_t at_ = 0;
};

// By file of targets:
void add_format_targets(std::vector<Target>& list);
void add_gltf_targets(std::vector<Target>& list);
void add_parts_targets(std::vector<Target>& list);
void add_scan_targets(std::vector<Target>& list);
void add_image_targets(std::vector<Target>& list);
void add_batch_targets(std::vector<Target>& list);
void add_http_targets(std::vector<Target>& list);

}  // namespace texmesh::fuzz
