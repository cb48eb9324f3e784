#pragma once
#include <nlohmann/json.hpp>

#include "format/base/bytes.h"

namespace texmesh {

/// "glTF", "JSON" and "BIN" as numbers, as a GLB file has them (glTF 2.0, section 4.4).
inline constexpr std::uint32_t kGlbMagic = 0x46546c67, kGlbJsonChunk = 0x4e4f534a,
                               kGlbBinaryChunk = 0x004e4942;

/// Appends bytes of the value `with` until the length is a multiple of 4, as chunks and accessors of a GLB
/// need it.
void pad_to_four(Bytes& out, std::uint8_t with);

/// A GLB file of version 2 (glTF 2.0, section 4.4) with both chunks. Each chunk is padded: JSON by spaces,
/// `binary` by zeros. FormatError where the file would have 4 GiB or more: its lengths have 32 bits. Nothing
/// is read or copied before.
Bytes glb_container(std::string_view json, ByteSpan binary);

/// A GLB's JSON and its binary chunk.
struct GlbParts {
  nlohmann::ordered_json root;
  Bytes binary;
};
/// FormatError for another file, and for JSON that parse_bounded_json() refuses. `entry` is for messages.
GlbParts read_glb(ByteSpan glb, const std::string& entry);

/// Takes an extension out of the lists of those that a document uses and requires.
void forget_extension(nlohmann::ordered_json& root, const std::string& name);

/// The same GLB with this asset.copyright; as it is for "". Order of names and every other value stay.
/// FormatError when it is no GLB.
Bytes with_copyright(const Bytes& glb, const std::string& line);

}  // namespace texmesh
