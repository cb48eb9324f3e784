#include "stages/gltf/decode_meshopt.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

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

/// What is wrong with the layout; nothing where all is well.
struct WrongLayout {
  std::string expected, found;
};
std::optional<WrongLayout> wrong_layout(const MeshoptStream& in) {
  const std::uint64_t stride = in.stride;
  const std::string found = std::to_string(in.count) + " elements of " + std::to_string(stride) + " bytes";
  if (in.mode == MeshoptMode::kAttributes) {
    const bool narrow = in.filter == MeshoptFilter::kOctahedral || in.filter == MeshoptFilter::kColour;
    const bool fits = narrow ? stride == 4 || stride == 8
                      : in.filter == MeshoptFilter::kQuaternion
                          ? stride == 8
                          : stride % 4 == 0 && stride >= 4 && stride <= 256;
    if (!fits) return WrongLayout{"a byteStride that mode and filter allow", found};
    return std::nullopt;
  }
  if (in.filter != MeshoptFilter::kNone) return WrongLayout{"no filter on indices", "one"};
  if (stride != 2 && stride != 4) return WrongLayout{"indices of 2 or 4 bytes", found};
  if (in.mode == MeshoptMode::kTriangles && in.count % 3 != 0) return WrongLayout{"whole triangles", found};
  return std::nullopt;
}

/// Fewest bytes that the codec spends on so many elements; a header that promises more is a lie, found
/// out before anything is allocated. Attributes: 2 bits per 16 bytes of one column; triangles and
/// indices: a byte each.
std::uint64_t fewest_bytes(const MeshoptStream& in) {
  if (is_meshopt_version1(in)) return fewest_attribute_bytes_v1(in.count, in.stride);
  if (in.mode == MeshoptMode::kAttributes) return in.count / 64 * in.stride;
  return in.mode == MeshoptMode::kTriangles ? in.count / 3 : in.count;
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
  const auto bits = value_at<std::uint32_t>(at);
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

std::optional<MeshoptMode> meshopt_mode(std::string_view name) {
  if (name == "ATTRIBUTES") return MeshoptMode::kAttributes;
  if (name == "TRIANGLES") return MeshoptMode::kTriangles;
  if (name == "INDICES") return MeshoptMode::kIndices;
  return std::nullopt;
}

std::optional<MeshoptFilter> meshopt_filter(std::string_view name) {
  if (name == "NONE") return MeshoptFilter::kNone;
  if (name == "OCTAHEDRAL") return MeshoptFilter::kOctahedral;
  if (name == "QUATERNION") return MeshoptFilter::kQuaternion;
  if (name == "EXPONENTIAL") return MeshoptFilter::kExponential;
  if (name == "COLOR") return MeshoptFilter::kColour;
  return std::nullopt;
}

bool is_meshopt_version1(const MeshoptStream& stream) {
  return stream.mode == MeshoptMode::kAttributes && !stream.data.empty() && stream.data[0] == kVersion1;
}

std::vector<std::uint8_t> decode_meshopt(const MeshoptStream& in, const MeshoptFailure& fail) {
  if (const auto wrong = wrong_layout(in)) fail(wrong->expected, wrong->found);
  if (in.count == 0) return {};
  // The codecs look at data[0] and at a tail before they compare lengths in some versions.
  if (in.data.empty() || fewest_bytes(in) > in.data.size())
    fail("data for " + std::to_string(in.count) + " elements", std::to_string(in.data.size()) + " bytes");
  std::vector<std::uint8_t> out(in.count * in.stride);
  const std::uint8_t* data = in.data.data();
  const std::size_t bytes = in.data.size();
  int status = 0;
  if (is_meshopt_version1(in))
    status = !decode_attributes_v1(in.data, in.count, in.stride, out);
  else if (in.mode == MeshoptMode::kAttributes)
    status = meshopt_decodeVertexBuffer(out.data(), in.count, in.stride, data, bytes);
  else if (in.mode == MeshoptMode::kTriangles)
    status = meshopt_decodeIndexBuffer(out.data(), in.count, in.stride, data, bytes);
  else
    status = meshopt_decodeIndexSequence(out.data(), in.count, in.stride, data, bytes);
  if (status != 0) fail("meshopt-compressed data", "other bytes");
  apply_filter(out, in.stride, in.filter);
  return out;
}

}  // namespace texmesh
