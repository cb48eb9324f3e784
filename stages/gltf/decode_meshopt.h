#pragma once
// Streams of EXT_meshopt_compression and KHR_meshopt_compression, in files of strangers: the same values on
// every processor.
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "format/base/bytes.h"

namespace texmesh {

enum class MeshoptMode : std::uint8_t { kAttributes, kTriangles, kIndices };
enum class MeshoptFilter : std::uint8_t { kNone, kOctahedral, kQuaternion, kExponential, kColour };
/// By the names in glTF. KHR_meshopt_compression alone has the filter of colours.
std::optional<MeshoptMode> meshopt_mode(std::string_view name);
std::optional<MeshoptFilter> meshopt_filter(std::string_view name);

struct MeshoptStream {
  ByteSpan data;
  std::uint64_t count = 0, stride = 0;  // elements, bytes of each; the product fits 64 bits
  MeshoptMode mode = MeshoptMode::kAttributes;
  MeshoptFilter filter = MeshoptFilter::kNone;
};

/// Whether these are attributes of version 1, which KHR_meshopt_compression alone has.
bool is_meshopt_version1(const MeshoptStream& stream);

/// Throws what the caller's errors are.
using MeshoptFailure = std::function<void(const std::string& expected, const std::string& found)>;
/// count * stride bytes. Allocates at most in proportion to the data.
std::vector<std::uint8_t> decode_meshopt(const MeshoptStream& stream, const MeshoptFailure& fail);

}  // namespace texmesh
