#include <meshoptimizer.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {
namespace {

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

}  // namespace texmesh::gltf
