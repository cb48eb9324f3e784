#pragma once
#include <optional>
#include <span>

#include "format/base/fields.h"

namespace texmesh {

/// How a plane's fragments are coded (SPEC.md, section Texture data). What is here moves bytes only: no
/// client needs an image library to make files of streams.
enum class Codec : std::uint8_t {
  kJpeg = 0,             // baseline, one table stream per rung
  kJpegProgressive = 1,  // one progressive file per fragment; a rung adds scans to the rungs below it
  kWebp = 2,             // a complete lossy WebP file per fragment and rung, no tables
  kJpegXy = 3            // as kJpeg, of vectors' x and y: who decodes makes z of them
};
template <>
struct EnumNames<Codec> {
  static constexpr std::array<std::string_view, 4> names{"jpeg", "jpeg-progressive", "webp", "jpeg-xy"};
};

struct CodecTraits {
  std::string_view id;                // in textures.json
  std::string_view required_feature;  // of the manifest; empty: every reader knows the codec
  std::string_view extension;         // of complete files, without the dot
  std::string_view media_type;
  /// A rung's streams continue those of the rungs below: a complete file needs all of them, and its bytes
  /// are their sum.
  bool incremental = false;
};
const CodecTraits& codec_traits(Codec codec);
/// Whether its fragments are complete baseline JPEGs (SPEC.md, F05).
constexpr bool is_baseline(Codec codec) { return codec == Codec::kJpeg || codec == Codec::kJpegXy; }
/// By id, the same with an extension; nothing for unknown ones.
std::optional<Codec> find_codec(std::string_view id);

/// Whether a rung's table stream can be one: SOI ... EOI, and empty for codecs without tables and for the
/// upper rungs of incremental ones.
bool is_table_stream(Codec codec, std::uint32_t rung, std::span<const std::uint8_t> tables);

/// The complete image file of one fragment. `tables` is the table stream of the rung, or of the lowest rung
/// for an incremental codec; `streams` is the rung's one stream, or those of the lowest rung up to it.
/// FormatError when a part cannot be one. Nothing is decoded.
std::vector<std::uint8_t> join_fragment(Codec codec, std::span<const std::uint8_t> tables,
                                        std::span<const std::span<const std::uint8_t>> streams);
std::vector<std::uint8_t> join_fragment(Codec codec, std::span<const std::uint8_t> tables,
                                        std::span<const std::uint8_t> stream);

/// The reverse: the rung's stream out of a complete file. `lower_bytes` is the sum of the streams of
/// lower rungs, for an incremental codec; ignored otherwise. FormatError when the file does not begin
/// with the tables.
std::vector<std::uint8_t> split_fragment(Codec codec, std::span<const std::uint8_t> tables,
                                         std::span<const std::uint8_t> file, std::uint64_t lower_bytes);

}  // namespace texmesh
