#include <meshoptimizer.h>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh {
namespace {

// Attribute streams of version 1 (KHR_meshopt_compression, mode ATTRIBUTES). Debian's meshoptimizer knows
// version 0 alone. A stream is a header byte, blocks of elements, and a tail: the element that the first
// differences count from, and a mode for every four bytes of an element (a *word*). A block holds a control
// byte for every word, then for every byte of an element the differences of that byte, element by element.

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

bool is_attributes_v1(ByteSpan data) { return !data.empty() && data[0] == kVersion1; }

/// Fewest bytes that so many elements take.
std::uint64_t fewest_attribute_bytes_v1(std::uint64_t count, std::uint64_t stride) {
  const std::uint64_t block = block_elements(stride);
  return 1 + (count / block + (count % block > 0)) * (stride / 4) +
         std::max<std::uint64_t>(stride + stride / 4, kLeastTail);
}

/// Fills `out`, which has count * stride bytes; `stride` is a multiple of 4 from 4 to 256. False when the
/// data are broken.
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

// Both versions, and the filters behind them.

void check_layout(const Source& source, const std::string& place, std::uint64_t count, std::uint64_t stride,
                  MeshoptMode mode, MeshoptFilter filter) {
  const auto found = [&] {
    return std::to_string(count) + " elements of " + std::to_string(stride) + " bytes";
  };
  if (mode == MeshoptMode::kAttributes) {
    const bool fits =
        filter == MeshoptFilter::kOctahedral || filter == MeshoptFilter::kColour ? stride == 4 || stride == 8
        : filter == MeshoptFilter::kQuaternion                                   ? stride == 8
                                               : stride % 4 == 0 && stride >= 4 && stride <= 256;
    if (!fits) source.fail(place, "a byteStride that mode and filter allow", found());
    return;
  }
  if (filter != MeshoptFilter::kNone) source.fail(place, "no filter on indices", "one");
  if (stride != 2 && stride != 4) source.fail(place, "indices of 2 or 4 bytes", found());
  if (mode == MeshoptMode::kTriangles && count % 3 != 0) source.fail(place, "whole triangles", found());
}

/// Fewest bytes that the codec spends on so many elements; a header that promises more is a lie, found
/// out before anything is allocated. Attributes: 2 bits per 16 bytes of one column; triangles and
/// indices: a byte each.
std::uint64_t fewest_bytes(ByteSpan data, std::uint64_t count, std::uint64_t stride, MeshoptMode mode) {
  if (mode == MeshoptMode::kAttributes && is_attributes_v1(data))
    return fewest_attribute_bytes_v1(count, stride);
  if (mode == MeshoptMode::kAttributes) return count / 64 * stride;
  return mode == MeshoptMode::kTriangles ? count / 3 : count;
}

// The filters are those of EXT_meshopt_compression and KHR_meshopt_compression, in scalar code:
// meshoptimizer's own use _mm_rsqrt_ps, whose last bits differ between processors, and convert what hostile
// data makes infinite.

template <class T>
T rounded(float value, float limit) {
  const float v = value + (value >= 0 ? 0.5f : -0.5f);
  return static_cast<T>(std::fmin(std::fmax(v, -limit), limit));
}

/// Four components of T: octahedral x and y, the length that stands for 1, and one that stays.
template <class T>
void decode_octahedral(std::uint8_t* at, float limit) {
  T v[4];
  std::memcpy(v, at, sizeof v);
  float x = v[0], y = v[1];
  const float z = static_cast<float>(v[2]) - std::fabs(x) - std::fabs(y);
  const float t = z >= 0 ? 0 : z;
  x += x >= 0 ? t : -t;
  y += y >= 0 ? t : -t;
  const float l = std::sqrt(x * x + y * y + z * z);
  const float s = l > 0 ? limit / l : 0;
  v[0] = rounded<T>(x * s, limit);
  v[1] = rounded<T>(y * s, limit);
  v[2] = rounded<T>(z * s, limit);
  std::memcpy(at, v, sizeof v);
}

/// Three of the four components of a unit quaternion; the last short says which one is missing and the scale.
void decode_quaternion(std::uint8_t* at) {
  constexpr float kLimit = 32767;
  std::int16_t v[4];
  std::memcpy(v, at, sizeof v);
  const float s = 0.70710678f / static_cast<float>(v[3] | 3);
  const float x = v[0] * s, y = v[1] * s, z = v[2] * s;
  const float w = std::sqrt(std::fmax(1 - x * x - y * y - z * z, 0.0f));
  const int missing = v[3] & 3;
  v[(missing + 1) & 3] = rounded<std::int16_t>(x * kLimit, kLimit);
  v[(missing + 2) & 3] = rounded<std::int16_t>(y * kLimit, kLimit);
  v[(missing + 3) & 3] = rounded<std::int16_t>(z * kLimit, kLimit);
  v[missing] = rounded<std::int16_t>(w * kLimit, kLimit);
  std::memcpy(at, v, sizeof v);
}

/// 8 bits of exponent and 24 of mantissa, both signed.
void decode_exponential(std::uint8_t* at) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, at, sizeof bits);
  const int mantissa = static_cast<std::int32_t>(bits << 8) >> 8;
  const int exponent = static_cast<std::int32_t>(bits) >> 24;
  const auto value = static_cast<float>(std::ldexp(static_cast<double>(mantissa), exponent));
  std::memcpy(at, &value, sizeof value);
}

/// Luma, two differences of colours and alpha, all of as many bits as alpha's highest one says: that bit is
/// no part of alpha, which has one bit less than the others.
template <class Unsigned, class Signed>
void decode_colour(std::uint8_t* at) {
  constexpr float kLargest = std::numeric_limits<Unsigned>::max();
  Unsigned v[4];
  std::memcpy(v, at, sizeof v);
  const int y = v[0], co = static_cast<Signed>(v[1]), cg = static_cast<Signed>(v[2]), stored = v[3];
  const int most = static_cast<int>(std::bit_ceil(static_cast<unsigned>(stored) + 1)) - 1;
  const int alpha = (stored << 1 & most) | (stored & 1);
  const float scale = most > 0 ? kLargest / static_cast<float>(most) : 0;
  const auto whole = [&](int x) {
    return static_cast<Unsigned>(std::fmin(std::fmax(static_cast<float>(x) * scale + 0.5f, 0.0f), kLargest));
  };
  v[0] = whole(y + co - cg);
  v[1] = whole(y + cg);
  v[2] = whole(y - co - cg);
  v[3] = whole(alpha);
  std::memcpy(at, v, sizeof v);
}

void apply_filter(std::vector<std::uint8_t>& bytes, std::uint64_t stride, MeshoptFilter filter) {
  const std::size_t step = filter == MeshoptFilter::kExponential ? 4 : stride;
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    switch (filter) {
      case MeshoptFilter::kNone:
        return;
      case MeshoptFilter::kOctahedral:
        if (stride == 4) {
          decode_octahedral<std::int8_t>(&bytes[at], 127);
        } else {
          decode_octahedral<std::int16_t>(&bytes[at], 32767);
        }
        break;
      case MeshoptFilter::kQuaternion:
        decode_quaternion(&bytes[at]);
        break;
      case MeshoptFilter::kExponential:
        decode_exponential(&bytes[at]);
        break;
      case MeshoptFilter::kColour:
        if (stride == 4) {
          decode_colour<std::uint8_t, std::int8_t>(&bytes[at]);
        } else {
          decode_colour<std::uint16_t, std::int16_t>(&bytes[at]);
        }
        break;
    }
  }
}

}  // namespace

std::vector<std::uint8_t> decode_meshopt(const Source& source, const std::string& place, ByteSpan data,
                                         std::uint64_t count, std::uint64_t stride, MeshoptMode mode,
                                         MeshoptFilter filter) {
  check_layout(source, place, count, stride, mode, filter);
  if (count == 0) return {};
  if (fewest_bytes(data, count, stride, mode) > data.size()) {
    source.fail(place, "data for " + std::to_string(count) + " elements",
                std::to_string(data.size()) + " bytes");
  }
  // The codecs look at data[0] and at a tail before they compare lengths in some versions.
  if (data.empty()) source.fail(place, "data", "0 bytes");
  std::vector<std::uint8_t> out(count * stride);
  int status = 0;
  switch (mode) {
    case MeshoptMode::kAttributes:
      status = is_attributes_v1(data)
                   ? !decode_attributes_v1(data, count, stride, out)
                   : meshopt_decodeVertexBuffer(out.data(), count, stride, data.data(), data.size());
      break;
    case MeshoptMode::kTriangles:
      status = meshopt_decodeIndexBuffer(out.data(), count, stride, data.data(), data.size());
      break;
    case MeshoptMode::kIndices:
      status = meshopt_decodeIndexSequence(out.data(), count, stride, data.data(), data.size());
      break;
  }
  if (status != 0) source.fail(place, "meshopt-compressed data", "other bytes");
  apply_filter(out, stride, filter);
  return out;
}

}  // namespace texmesh
