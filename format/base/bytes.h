#pragma once
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "format/base/errors.h"

namespace texmesh {

using Bytes = std::vector<std::uint8_t>;
using ByteSpan = std::span<const std::uint8_t>;

/// The value whose bytes stand at a place, which need not be aligned.
template <class T>
T value_at(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

// Little-endian writing and bounded reading of the package's binary entries.

/// Builds an entry.
class BytesOut {
 public:
  void number(std::uint64_t value, int width) {
    for (int i = 0; i < width; ++i) bytes_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
  void u8(std::uint64_t v) { number(v, 1); }
  void u16(std::uint64_t v) { number(v, 2); }
  void u32(std::uint64_t v) { number(v, 4); }
  void u64(std::uint64_t v) { number(v, 8); }
  void f32(float v) { number(std::bit_cast<std::uint32_t>(v), 4); }
  void raw(ByteSpan v) { bytes_.insert(bytes_.end(), v.begin(), v.end()); }
  void text(std::string_view v) { bytes_.insert(bytes_.end(), v.begin(), v.end()); }
  std::size_t size() const { return bytes_.size(); }
  /// The bytes; the writer is empty afterwards.
  Bytes finish() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// Reads an entry. Throws FormatError(name, "byte N", ...) instead of reading past the end.
class BytesIn {
 public:
  BytesIn(ByteSpan bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}
  std::uint64_t number(int width) {
    const auto p = raw(static_cast<std::size_t>(width));
    std::uint64_t v = 0;
    for (int i = 0; i < width; ++i)
      v |= static_cast<std::uint64_t>(p[static_cast<std::size_t>(i)]) << (8 * i);
    return v;
  }
  std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t u64() { return number(8); }
  float f32() { return std::bit_cast<float>(u32()); }
  ByteSpan raw(std::uint64_t bytes) {
    if (bytes > left()) fail(std::to_string(bytes) + " bytes", std::to_string(left()) + " bytes");
    const auto part = bytes_.subspan(at_, static_cast<std::size_t>(bytes));
    at_ += static_cast<std::size_t>(bytes);
    return part;
  }
  std::string text(std::uint64_t bytes) {
    const auto p = raw(bytes);
    return std::string(p.begin(), p.end());
  }
  /// The next bytes must be these; for magic words and reserved fields.
  void expect(std::string_view what, std::string_view bytes) {
    const std::size_t at = at_;
    if (text(bytes.size()) != bytes) {
      at_ = at;
      fail(std::string(what), "other bytes");
    }
  }
  void finish() const {
    if (left() != 0) fail("the end", std::to_string(left()) + " more bytes");
  }
  std::size_t at() const { return at_; }
  std::size_t left() const { return bytes_.size() - at_; }
  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw FormatError(name_, "byte " + std::to_string(at_), std::move(expected), std::move(found));
  }

 private:
  ByteSpan bytes_;
  std::string name_;
  std::size_t at_ = 0;
};

}  // namespace texmesh
