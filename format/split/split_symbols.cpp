#include "format/split/split_symbols.h"

#include <algorithm>
#include <array>

#include "format/split/split_coder.h"

namespace texmesh {
namespace {

/// Counts how often each model's bit is 1.
struct CountingBits {
  ResidualCodec& residuals;
  std::vector<std::array<std::uint32_t, 2>>& counts;
  bool bit(BitModel& model, bool value) {
    ++counts[static_cast<std::size_t>(&model - residuals.models.all.data())][value];
    return value;
  }
  std::uint32_t raw(std::uint32_t value, int) { return value; }
};

struct CodingBits {
  BitEncoder encoder;
  bool bit(BitModel& model, bool value) {
    encoder.encode(model, value, ValueModels::kLimit);
    return value;
  }
  std::uint32_t raw(std::uint32_t value, int count) {
    encoder.encode_raw(value, count);
    return value;
  }
};

/// Where the running mean of a block's residual lengths starts, in eighths of a bit.
std::uint8_t first_mean(const Symbols& symbols) {
  constexpr std::uint32_t kLooked = 30;
  std::uint32_t sum = 0, count = 0;
  for (std::int32_t s : symbols) {
    if (s == kSame || s == kOther) continue;
    sum += static_cast<std::uint32_t>(residual_length(s));
    if (++count == kLooked) break;
  }
  return static_cast<std::uint8_t>(count > 0 ? (8 * sum + count / 2) / count : 0);
}

template <class Bits>
void code_all(ResidualCodec& residuals, Bits& bits, const Symbols& symbols, int components) {
  residuals.start(first_mean(symbols) * 2);
  int component = 0;
  for (std::int32_t s : symbols) {
    if (s == kSame || s == kOther) {
      residuals.same(bits, s == kSame);
    } else {
      residuals.residual(bits, component, s);
      component = component + 1 == components ? 0 : component + 1;
    }
  }
}

}  // namespace

std::vector<std::uint8_t> start_models(const std::vector<std::vector<Symbols>>& blocks, std::size_t part,
                                       int components) {
  std::vector<std::array<std::uint32_t, 2>> counts(ValueModels::kCount);
  for (const auto& block : blocks) {
    ResidualCodec residuals;
    CountingBits bits{residuals, counts};
    code_all(residuals, bits, block[part], components);
  }
  std::vector<std::uint8_t> models;
  for (const auto& [zeros, ones] : counts) {
    const double share = (ones + 0.5) / (static_cast<double>(zeros) + ones + 1);
    models.push_back(static_cast<std::uint8_t>(std::clamp(static_cast<int>(share * 256 + 0.5), 1, 255)));
  }
  return models;
}

std::vector<std::uint8_t> code_symbols(const Symbols& symbols, const std::vector<std::uint8_t>& models,
                                       int components) {
  if (symbols.empty()) return {};
  ResidualCodec residuals;
  for (std::size_t i = 0; i < models.size(); ++i)
    residuals.models.all[i] = {static_cast<std::uint16_t>(models[i] << 8), ValueModels::kPrior};
  CodingBits bits;
  code_all(residuals, bits, symbols, components);
  std::vector<std::uint8_t> out{first_mean(symbols)};
  const std::vector<std::uint8_t> coded = bits.encoder.finish();
  out.insert(out.end(), coded.begin(), coded.end());
  return out;
}

}  // namespace texmesh
