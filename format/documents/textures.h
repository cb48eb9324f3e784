#pragma once

#include "format/documents/index.h"
#include "format/model/codec.h"

namespace texmesh {

/// textures.json: one element per texture plane, in plane order. It says what the planes are; where their
/// bytes stand is said by the index only, so the file needs no offsets: writing leaves offset, bytes and
/// digest of the refs out, reading fills in the paths, and resolve_textures() the rest.
struct TextureInfo {
  std::uint32_t image = 0;  // GLB image "texture/<image>"
  std::uint32_t mip = 0;    // sides are 1 / 2^mip of the full-size plane's, rounded up; 0 = full size
  std::uint32_t base = 0;   // of a mip: the full-size plane
  // base-colour, emissive, normal, occlusion-roughness-metallic, alpha, colour or data.
  std::string role;
  std::string name;          // as the source names the image
  std::string colour_space;  // srgb | linear
  Codec codec = Codec::kJpeg;
  std::uint32_t width_px = 0, height_px = 0, channels = 3;
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;
  std::string grid_reason;
  std::uint32_t preview_width_px = 0, preview_height_px = 0;
  EntryRef preview;  // preview/NNN.jpg; that of the full-size plane for a mip
  EntryRef tables;   // texture/<plane>/tables.pack, all rungs' table streams in rung order
  // texture/<plane>/rNN.pack by rising quality: fragments in PlaneTables::order.
  std::vector<EntryRef> rungs;
  std::vector<int> rung_quality;
  bool source_rung = false;  // the last rung holds the coefficients of the source, a JPEG
  // jpg, png, tif, webp or exr where the package holds the source image; "" = it does not.
  std::string source_extension;
  bool source_colours = true;  // its numbers are the plane's; false: import has converted them
  EntryRef source;             // source/NNN.<extension>
  friend bool operator==(const TextureInfo&, const TextureInfo&) = default;
};
/// How many of the planes have full size; they stand first.
std::size_t full_size_planes(const std::vector<TextureInfo>& textures);
std::string write_textures(const std::vector<TextureInfo>& textures);
std::vector<TextureInfo> read_textures(std::span<const std::uint8_t> json);
/// Fills offset, bytes and digest of every ref from the index; FormatError when an entry is not there.
void resolve_textures(std::vector<TextureInfo>& textures, const std::vector<EntryRef>& index);

}  // namespace texmesh
