#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

// The entropy coder of mesh/stream.bin (SPEC.md, section Split stream): binary decisions with adaptive
// probabilities in a carry-propagating range coder. Everything is 32-bit unsigned arithmetic without a
// product of more than 32 bits, so that a client in TypeScript computes the same with Math.imul and >>> 0.

/// Probability that a bit is 1. It learns by the reciprocal of what it has seen, down to 1 / (limit + 2).
struct BitModel {
  std::uint16_t p = 0x8000;  // of 65,536
  std::uint8_t seen = 0;

  std::uint32_t odds() const { return std::clamp<std::uint32_t>(p >> 4, 1, 4095); }  // of 4,096
  void learn(bool bit, std::uint8_t limit) {
    const std::uint32_t weight = 65535u / (seen + 2u);
    if (bit)
      p = static_cast<std::uint16_t>(p + (((65535u - p) * weight) >> 16));
    else
      p = static_cast<std::uint16_t>(p - ((p * weight) >> 16));
    if (seen < limit) ++seen;
  }
};

class BitEncoder {
 public:
  void encode(BitModel& model, bool bit, std::uint8_t limit) {
    put(model.odds(), bit);
    model.learn(bit, limit);
  }
  /// The lowest `count` bits of `value`, highest first, at one bit each.
  void encode_raw(std::uint32_t value, int count) {
    while (count-- > 0) put(2048, (value >> count) & 1);
  }
  /// Ends the code; the encoder can be used again. Zeros at the end are left out: the decoder
  /// reads them anyway.
  std::vector<std::uint8_t> finish() {
    // Of all numbers in [low, low + range) the one with the most zeros at its end.
    const std::uint64_t last = low_ + range_ - 1;
    std::uint64_t code = last;
    for (int zeros = 1; zeros <= 32; ++zeros) {
      const std::uint64_t candidate = last >> zeros << zeros;
      if (candidate < low_) break;
      code = candidate;
    }
    low_ = code;
    for (int i = 0; i < 5; ++i) shift();
    bytes_.erase(bytes_.begin());  // the coder's first byte is always 0
    while (!bytes_.empty() && bytes_.back() == 0) bytes_.pop_back();
    std::vector<std::uint8_t> out = std::move(bytes_);
    *this = BitEncoder{};
    return out;
  }

 private:
  void put(std::uint32_t odds, bool bit) {
    const std::uint32_t bound = (range_ >> 12) * odds;
    if (bit) {
      range_ = bound;
    } else {
      low_ += bound;
      range_ -= bound;
    }
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      shift();
    }
  }
  void shift() {
    if (low_ < 0xff000000u || low_ > 0xffffffffu) {
      const auto carry = static_cast<std::uint8_t>(low_ >> 32);
      bytes_.push_back(static_cast<std::uint8_t>(held_ + carry));
      for (; pending_ > 0; --pending_) bytes_.push_back(static_cast<std::uint8_t>(0xff + carry));
      held_ = static_cast<std::uint8_t>(low_ >> 24);
    } else {
      ++pending_;
    }
    low_ = (low_ & 0x00ffffffu) << 8;
  }
  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xffffffffu, pending_ = 0;
  std::uint8_t held_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// Reads zeros behind the end.
class BitDecoder {
 public:
  explicit BitDecoder(std::span<const std::uint8_t> bytes = {}) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i) code_ = code_ << 8 | next();
  }
  bool decode(BitModel& model, std::uint8_t limit) {
    const bool bit = decode_by_odds(model.odds());
    model.learn(bit, limit);
    return bit;
  }
  std::uint32_t decode_raw(int count) {
    std::uint32_t value = 0;
    while (count-- > 0) value = value << 1 | static_cast<std::uint32_t>(decode_by_odds(2048));
    return value;
  }

 private:
  std::uint32_t next() { return at_ < bytes_.size() ? bytes_[at_++] : 0; }
  bool decode_by_odds(std::uint32_t odds) {
    const std::uint32_t bound = (range_ >> 12) * odds;
    const bool bit = code_ < bound;
    if (bit) {
      range_ = bound;
    } else {
      code_ -= bound;
      range_ -= bound;
    }
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      code_ = code_ << 8 | next();
    }
    return bit;
  }
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint32_t range_ = 0xffffffffu, code_ = 0;
};

/// Models of one part of values. Residuals are coded as the length of their magnitude in bits, in steps
/// relative to a running mean of lengths, then the two bits below the leading one, then the rest raw.
struct ValueModels {
  static constexpr int kSteps = 20, kBelow = 12;
  static constexpr std::uint8_t kLimit = 60, kPrior = 24;  // a stream's models count as so many symbols seen
  static constexpr std::size_t kCount = 4 * kSteps + 3 * kBelow + 1;
  std::array<BitModel, kCount> all;
  BitModel& longer(int quarter, int step) { return all[static_cast<std::size_t>(quarter * kSteps + step)]; }
  BitModel& second(int length) { return all[static_cast<std::size_t>(4 * kSteps + below(length))]; }
  BitModel& third(int length, std::uint32_t higher) {
    return all[4 * kSteps + kBelow + 2 * static_cast<std::size_t>(below(length)) + higher];
  }
  BitModel& same() { return all[kCount - 1]; }
  static int below(int length) { return std::min(length, kBelow - 1); }
};

/// Bits of the magnitude of a residual: 0 for 0.
inline int residual_length(std::int32_t residual) {
  return std::bit_width(static_cast<std::uint32_t>(residual < 0 ? -residual : residual));
}

/// Codes residuals through `bits`, which is given the model (or a number of raw bits) and returns what was
/// coded; so the encoder and the decoder are the same code.
class ResidualCodec {
 public:
  static constexpr int kLongest = 26;
  ValueModels models;
  void start(int mean) { mean_.fill(mean); }  // in sixteenths of a bit

  std::int32_t residual(auto& bits, int component, std::int32_t value) {
    int& mean = mean_[static_cast<std::size_t>(component)];
    const int length = code_length(bits, mean, residual_length(value));
    mean += (length * 16 - mean) >> 3;
    if (length == 0) return 0;
    std::uint32_t magnitude = static_cast<std::uint32_t>(value < 0 ? -value : value), coded = 1;
    int left = length - 1;
    if (left > 0) coded = coded << 1 | bits.bit(models.second(length), (magnitude >> --left) & 1);
    if (left > 0) coded = coded << 1 | bits.bit(models.third(length, coded & 1), (magnitude >> --left) & 1);
    if (left > 0) coded = coded << left | bits.raw(magnitude & ((1u << left) - 1), left);
    const auto signed_value = static_cast<std::int32_t>(coded);
    return bits.raw(value < 0, 1) ? -signed_value : signed_value;
  }
  bool same(auto& bits, bool value) { return bits.bit(models.same(), value); }

 private:
  int code_length(auto& bits, int mean, int length) {
    const int middle = mean >> 4;
    auto is_longer = [&](int than) {
      const int step = std::clamp(than - middle + 10, 0, ValueModels::kSteps - 1);
      return bits.bit(models.longer((mean >> 2) & 3, step), length > than);
    };
    int at = std::clamp(middle - 2, 0, kLongest - 1);
    if (is_longer(at)) {
      do ++at;
      while (at < kLongest && is_longer(at));
    } else {
      while (at > 0 && !is_longer(at - 1)) --at;
    }
    return at;
  }
  std::array<int, 4> mean_{};  // per component
};

}  // namespace texmesh
