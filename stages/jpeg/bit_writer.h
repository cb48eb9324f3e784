#pragma once
// Inside stages only.
#include <cstddef>
#include <cstdint>

#include "format/base/bytes.h"

namespace texmesh {

/// Appends the entropy-coded bits of a JPEG to `out`, the first bit highest, with a zero behind every 0xff.
/// `out` is larger than what is written until finish().
class BitWriter {
 public:
  explicit BitWriter(Bytes& out) : out_(&out), used_(out.size()) {}
  /// Before put(): room for so many bytes, zeros behind 0xff included.
  void reserve(std::size_t bytes) {
    if (out_->size() - used_ < bytes + kMostHeldBytes)
      out_->resize(2 * out_->size() + bytes + kMostHeldBytes);
  }
  /// The lowest `count` bits of `value`, whose others are 0; count <= 32.
  void put(std::uint32_t value, unsigned count) {
    held_ = held_ << count | value;
    count_ += count;
    while (count_ >= 32) {
      count_ -= 32;
      write_word(static_cast<std::uint32_t>(held_ >> count_));
    }
  }
  /// Fills the last byte with ones and cuts `out` to what was written.
  void finish() {
    reserve(0);
    if (count_ > 0) {
      const unsigned fill = (8 - count_ % 8) % 8;
      put((1u << fill) - 1, fill);
    }
    while (count_ > 0) write(static_cast<std::uint8_t>(held_ >> (count_ -= 8)));
    out_->resize(used_);
  }

 private:
  static constexpr std::size_t kMostHeldBytes = 8;  // 31 bits and the zeros behind them
  void write_word(std::uint32_t word) {
    const bool has_ff = ((~word - 0x01010101u) & word & 0x80808080u) != 0;
    std::uint8_t* to = out_->data() + used_;
    for (unsigned shift = 32; shift > 0;) {
      *to++ = static_cast<std::uint8_t>(word >> (shift -= 8));
      if (has_ff && to[-1] == 0xff) *to++ = 0;
    }
    used_ = static_cast<std::size_t>(to - out_->data());
  }
  void write(std::uint8_t byte) {
    (*out_)[used_++] = byte;
    if (byte == 0xff) (*out_)[used_++] = 0;
  }
  Bytes* out_;
  std::size_t used_;
  std::uint64_t held_ = 0;
  unsigned count_ = 0;
};

}  // namespace texmesh
