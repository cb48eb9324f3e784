#include <algorithm>
#include <array>
#include <cstring>

#include "pipeline/import/gltf/import_gltf_parts.h"

// Attribute streams of version 1 (KHR_meshopt_compression, mode ATTRIBUTES). Debian's meshoptimizer knows
// version 0 alone. A stream is a header byte, blocks of elements, and a tail: the element that the first
// differences count from, and a mode for every four bytes of an element (a *word*). A block holds a control
// byte for every word, then for every byte of an element the differences of that byte, element by element.

namespace texmesh::gltf {
namespace {

constexpr std::uint8_t kVersion1 = 0xa1;
constexpr std::size_t kGroup = 16, kMostBlock = 256, kBlockBytes = 8192, kLeastTail = 24;

/// Takes bytes from the front; `good` is false once there were too few.
struct Input {
  ByteSpan bytes;
  bool good = true;
  ByteSpan take(std::size_t n) {
    if (n > bytes.size()) good = false;
    if (!good) return {};
    const ByteSpan taken = bytes.first(n);
    bytes = bytes.subspan(n);
    return taken;
  }
};

/// 16 values of so many bits each; the greatest value says that a whole byte follows behind the group.
void read_group(Input& in, unsigned bits, std::uint8_t* out) {
  if (bits == 0) {
    std::memset(out, 0, kGroup);
    return;
  }
  const ByteSpan packed = in.take(kGroup * bits / 8);
  if (!in.good) return;
  if (bits == 8) {
    std::memcpy(out, packed.data(), kGroup);
    return;
  }
  const unsigned escape = (1u << bits) - 1, per_byte = 8 / bits;
  for (unsigned i = 0; i < kGroup && in.good; ++i) {
    const unsigned at = i % per_byte;
    // Single bits stand with the lowest first, wider values with the highest first.
    const unsigned shift = bits == 1 ? at : 8 - bits * (at + 1);
    const unsigned value = packed[i / per_byte] >> shift & escape;
    if (value != escape) {
      out[i] = static_cast<std::uint8_t>(value);
    } else if (const ByteSpan whole = in.take(1); in.good) {
      out[i] = whole[0];
    }
  }
}

/// One byte of all elements of a block, as its two bits of control say.
void read_bytes(Input& in, unsigned control, std::size_t count, std::uint8_t* out) {
  constexpr std::array<std::array<unsigned, 4>, 2> kBits{{{0, 1, 2, 4}, {1, 2, 4, 8}}};
  if (control == 2) {
    std::memset(out, 0, count);
  } else if (control == 3) {
    const ByteSpan plain = in.take(count);
    if (in.good) std::memcpy(out, plain.data(), count);
  } else {
    const std::size_t groups = (count + kGroup - 1) / kGroup;
    const ByteSpan widths = in.take((groups + 3) / 4);
    for (std::size_t g = 0; g < groups && in.good; ++g)
      read_group(in, kBits[control][widths[g / 4] >> (g % 4 * 2) & 3], out + g * kGroup);
  }
}

template <class T>
T unzigzag(T v) {
  return static_cast<T>((v >> 1) ^ static_cast<T>(0 - (v & 1)));
}

/// Undoes the differences of one word: `bytes` are its four bytes, each of all elements. `last` is the word
/// of the element before the block, and then that of the block's last one.
template <class T>
void add_differences(const std::uint8_t* bytes, std::size_t row, std::size_t count, unsigned mode,
                     std::uint8_t* last, std::uint8_t* out, std::size_t stride) {
  constexpr unsigned kWordBits = 32;
  for (std::size_t part = 0; part < 4; part += sizeof(T)) {
    T value = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k) value = static_cast<T>(value | T{last[part + k]} << (8 * k));
    for (std::size_t i = 0; i < count; ++i) {
      T d = 0;
      for (std::size_t k = 0; k < sizeof(T); ++k)
        d = static_cast<T>(d | T{bytes[(part + k) * row + i]} << (8 * k));
      if constexpr (sizeof(T) == 4) {
        const unsigned turn = mode >> 4 & (kWordBits - 1);
        value ^= turn == 0 ? d : d >> turn | d << (kWordBits - turn);
      } else {
        value = static_cast<T>(value + unzigzag(d));
      }
      for (std::size_t k = 0; k < sizeof(T); ++k)
        out[i * stride + part + k] = static_cast<std::uint8_t>(value >> (8 * k));
    }
    for (std::size_t k = 0; k < sizeof(T); ++k) last[part + k] = static_cast<std::uint8_t>(value >> (8 * k));
  }
}

bool read_block(Input& in, ByteSpan modes, std::size_t count, std::size_t stride, std::uint8_t* last,
                std::uint8_t* out) {
  const ByteSpan control = in.take(stride / 4);
  // Groups are whole: those of a short block reach beyond its elements.
  std::array<std::uint8_t, 4 * kMostBlock> bytes;
  for (std::size_t word = 0; word < stride / 4 && in.good; ++word) {
    for (std::size_t k = 0; k < 4 && in.good; ++k)
      read_bytes(in, control[word] >> (2 * k) & 3, count, bytes.data() + k * kMostBlock);
    if (!in.good) return false;
    const unsigned mode = modes[word];
    const auto add = [&](auto type) {
      add_differences<decltype(type)>(bytes.data(), kMostBlock, count, mode, last + 4 * word, out + 4 * word,
                                      stride);
    };
    switch (mode & 3) {
      case 0:
        add(std::uint8_t{});
        break;
      case 1:
        add(std::uint16_t{});
        break;
      case 2:
        add(std::uint32_t{});
        break;
      default:
        return false;
    }
  }
  return in.good;
}

std::size_t block_elements(std::size_t stride) {
  return std::min(kBlockBytes / stride / kGroup * kGroup, kMostBlock);
}

}  // namespace

bool is_attributes_v1(ByteSpan data) { return !data.empty() && data[0] == kVersion1; }

std::uint64_t fewest_attribute_bytes_v1(std::uint64_t count, std::uint64_t stride) {
  const std::uint64_t block = block_elements(stride);
  return 1 + (count / block + (count % block > 0)) * (stride / 4) +
         std::max<std::uint64_t>(stride + stride / 4, kLeastTail);
}

bool decode_attributes_v1(ByteSpan data, std::size_t count, std::size_t stride,
                          std::vector<std::uint8_t>& out) {
  const std::size_t tail_bytes = std::max(stride + stride / 4, kLeastTail);
  if (data.size() < 1 + tail_bytes) return false;
  const ByteSpan tail = data.last(stride + stride / 4);
  std::vector<std::uint8_t> last(tail.begin(), tail.begin() + static_cast<std::ptrdiff_t>(stride));
  Input in{data.subspan(1, data.size() - 1 - tail_bytes)};
  for (std::size_t at = 0; at < count;) {
    const std::size_t n = std::min(block_elements(stride), count - at);
    if (!read_block(in, tail.subspan(stride), n, stride, last.data(), out.data() + at * stride)) return false;
    at += n;
  }
  return in.bytes.empty();
}

}  // namespace texmesh::gltf
