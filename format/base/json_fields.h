#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "format/base/sha256.h"

namespace texmesh {

// Strict reading of the package's JSON documents.

/// Largest integer that every JSON reader keeps: 2^53.
inline constexpr std::uint64_t kMaxJsonInteger = std::uint64_t{1} << 53;
inline constexpr int kMaxJsonDepth = 64;

/// Size, depth (checked before parsing, so that no input can exhaust a stack), repeated names (J10),
/// syntax, UTF-8 (J01) and numbers (J02) are checked; RuleError names `file` and the byte.
nlohmann::json parse_json(std::span<const std::uint8_t> bytes, const std::string& file,
                          std::uint64_t max_bytes);

/// Without blanks, numbers in the shortest form that reads back the same; FormatError when a text
/// is not UTF-8.
std::string dump_json(const nlohmann::ordered_json& json, const std::string& file);

/// In the shortest form that reads back the same.
std::string shortest_text(double value);
/// The double whose decimal form is the shortest for this float, so that dump_json writes no noise digits.
double shortest_double(float value);
/// `value` rounded to six significant decimal digits.
double six_digits(double value);

/// A value and its JSON pointer. Every accessor checks the type and the range and throws RuleError otherwise:
/// J04 where no other rule was named, J03 for control characters, J07 for digests.
class JsonAt {
 public:
  JsonAt(const nlohmann::json& value, const std::string& file, std::string pointer = "")
      : value_(value), file_(file), pointer_(std::move(pointer)) {}
  /// The same value; what is wrong with it or within it breaks `rule`.
  JsonAt by(const char* rule) const;
  JsonAt operator[](std::string_view name) const;  // must be there, else J04
  JsonAt operator[](std::size_t index) const;      // of an array, index < size()
  bool has(std::string_view name) const;           // for fields that may be absent
  std::size_t array(std::size_t min_size, std::size_t max_size) const;
  std::uint64_t integer(std::uint64_t lo, std::uint64_t hi = kMaxJsonInteger) const;
  double number(double lo, double hi) const;
  bool boolean() const;
  /// Control characters are refused: these texts end up on terminals and in pages.
  std::string text(std::size_t max_bytes) const;
  Sha256 digest() const;
  [[noreturn]] void fail(const std::string& expected, const std::string& found) const;

 private:
  [[noreturn]] void fail_type(const char* expected) const;
  const nlohmann::json& value_;
  const std::string& file_;
  std::string pointer_;
  const char* rule_ = "J04";
};

}  // namespace texmesh
