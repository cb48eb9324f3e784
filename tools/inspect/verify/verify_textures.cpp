// Texture planes: their tables, previews, table streams, fragments, and the source images that they keep.
#include <numeric>
#include <set>
#include <tuple>

#include "format/rules/allocation.h"
#include "pipeline/io/table.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/image/jpeg_segments.h"
#include "stages/jpeg/jpeg.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

std::string plane_field(std::uint32_t plane, const std::string& member) {
  return "plane " + std::to_string(plane) + ", " + member;
}

std::uint64_t sum(const std::vector<std::uint32_t>& v) {
  return std::accumulate(v.begin(), v.end(), std::uint64_t{0});
}

/// Stored fragments are covered, and stand by falling importance. (Readers check that covered ones are
/// stored.)
void check_order(std::uint32_t plane, const PlaneTables& t, Findings& findings) {
  for (const std::uint16_t f : t.order)
    findings.require(t.covered_texels[f] > 0, {"tables-coverage", "T11"}, kTablesPath,
                     plane_field(plane, "fragment " + std::to_string(f)), "covered texels, as it is stored",
                     "none");
  const std::vector<float> eta = eta_of(t, 0);
  for (std::size_t k = 1; k < t.order.size(); ++k) {
    const std::size_t a = t.order[k - 1], b = t.order[k];
    const bool falling = eta[a] != eta[b] ? eta[a] > eta[b]
                         : t.surface_fraction[a] != t.surface_fraction[b]
                             ? t.surface_fraction[a] > t.surface_fraction[b]
                             : a < b;
    findings.require(
        falling, {"tables-order", "T12"}, kTablesPath, plane_field(plane, "order[" + std::to_string(k) + "]"),
        "falling importance (eta, surface, index)", std::to_string(b) + " after " + std::to_string(a));
  }
}

void check_fragment(const TextureInfo& texture, const PlaneTables& t, std::uint32_t rung, std::size_t i,
                    const PlaneStreams& streams, Findings& findings) {
  const std::string& entry = texture.rungs[rung].path;
  const std::string field = "fragment " + std::to_string(i);
  const std::uint64_t stated = t.digest[rung * t.fragment_count() + i],
                      real = truncated(sha256(streams.stream(i)));
  if (stated != real) {
    const auto hex = [](std::uint64_t v) {
      char text[20];
      std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(v));
      return std::string(text);
    };
    findings.add({"fragment-digest", "F03"}, entry, field, hex(stated), hex(real));
  }
  try {
    const std::uint64_t texels =
        static_cast<std::uint64_t>(texture.fragment_width_px) * texture.fragment_height_px;
    const Pixels pixels = decode_fragment_file(texture.codec, streams.file(i), texels);
    findings.require(
        pixels.width_px == texture.fragment_width_px && pixels.height_px == texture.fragment_height_px &&
            pixels.channels == texture.channels,
        {"fragment-decode", "F08"}, entry, field,
        std::to_string(texture.fragment_width_px) + " x " + std::to_string(texture.fragment_height_px) +
            " px, " + std::to_string(texture.channels) + " channels",
        std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px) + " px, " +
            std::to_string(pixels.channels) + " channels");
  } catch (const Error& e) {
    const std::string rule = rule_of(e);
    findings.add({"fragment-decode", rule.empty() ? "F08" : rule.c_str()}, entry, field, e.expected(),
                 e.found());
  }
}

constexpr std::uint8_t kExif = 0xe1, kProfile = 0xe2, kRestartInterval = 0xdd;

/// What stands in front of a JPEG's first scan.
struct JpegSegments {
  bool has_profile = false, has_restarts = false;
  std::vector<std::uint8_t> frame;  // per component: sampling factors
};

JpegSegments read_segments(ByteSpan jpeg) {
  JpegSegments found;
  for_each_jpeg_segment(jpeg, [&](std::uint8_t marker, ByteSpan body) {
    found.has_profile |= marker == kExif || marker == kProfile;
    found.has_restarts |= marker == kRestartInterval;
    if (is_jpeg_frame(marker))
      for (std::size_t k = 7; k < body.size(); k += 3) found.frame.push_back(body[k]);
  });
  return found;
}

void check_jpeg_head(const std::string& entry, const std::string& field, std::span<const std::uint8_t> jpeg,
                     Findings& findings) {
  findings.require(!read_segments(jpeg).has_profile, {"jpeg-head", "F10"}, entry, field,
                   "neither EXIF nor a colour profile", "one");
}

void check_source_rung(const TextureInfo& texture, std::span<const std::span<const std::uint8_t>> tables,
                       Findings& findings) {
  const std::string& entry = texture.tables.path;
  const JpegSegments last = read_segments(tables.back());
  std::uint32_t h = 1, v = 1;
  for (const std::uint8_t factors : last.frame) {
    h = std::max<std::uint32_t>(h, factors >> 4), v = std::max<std::uint32_t>(v, factors & 15);
    const auto is_factor = [](int f) { return f == 1 || f == 2 || f == 4; };
    findings.require(is_factor(factors >> 4) && is_factor(factors & 15), {"source-rung", "F13"}, entry, "",
                     "sampling factors 1, 2 and 4",
                     std::to_string(factors >> 4) + ", " + std::to_string(factors & 15));
  }
  for (std::size_t r = 0; r < tables.size(); ++r)
    findings.require(read_segments(tables[r]).frame == last.frame, {"source-rung", "F13"}, entry,
                     "rung " + std::to_string(r), "the components of the last rung", "others");
  findings.require(!last.has_restarts, {"source-rung", "F12"}, entry, "last rung", "no restart interval",
                   "one");
  findings.require(
      texture.fragment_width_px % (8 * h) == 0 && texture.fragment_height_px % (8 * v) == 0,
      {"source-rung", "F12"}, entry, "last rung", "fragments of whole MCUs",
      std::to_string(texture.fragment_width_px) + " x " + std::to_string(texture.fragment_height_px) + " px");
}

}  // namespace

void check_textures(const Manifest& m, const std::vector<TextureInfo>& textures, const PackageTables& tables,
                    Findings& findings) {
  findings.require_equal<std::uint64_t>(m.plane_count, textures.size(), {"textures", "R04"}, kTexturesPath,
                                        "");
  findings.require_equal<std::uint64_t>(m.plane_count, tables.planes.size(), {"tables", "R04"}, kTablesPath,
                                        "planes");
  std::set<std::tuple<std::uint32_t, bool, std::uint32_t>> seen;
  for (std::size_t k = 0; k < std::min(textures.size(), tables.planes.size()); ++k) {
    const TextureInfo& info = textures[k];
    const PlaneTables& t = tables.planes[k];
    const std::string place = "/" + std::to_string(k);
    findings.require(seen.insert({info.image, info.role == "alpha", info.mip}).second, {"textures", "X08"},
                     kTexturesPath, place,
                     "one plane for the colours and one for the alpha of image " +
                         std::to_string(info.image) + " at every size",
                     "another");
    findings.require(info.columns == t.columns && info.rows == t.rows, {"tables-grid", "R08"}, kTablesPath,
                     plane_field(static_cast<std::uint32_t>(k), "grid"),
                     std::to_string(info.columns) + " x " + std::to_string(info.rows),
                     std::to_string(t.columns) + " x " + std::to_string(t.rows));
    findings.require_equal<std::uint64_t>(m.scales.size(), t.scale_count(), {"tables-scales", "R11"},
                                          kTablesPath, plane_field(static_cast<std::uint32_t>(k), "scales"));
    findings.require(std::equal(info.rung_quality.begin(), info.rung_quality.end(), t.rung_quality.begin(),
                                t.rung_quality.end()) &&
                         info.rungs.size() == info.rung_quality.size(),
                     {"tables-rungs", "R09"}, kTablesPath,
                     plane_field(static_cast<std::uint32_t>(k), "rungs"),
                     std::to_string(info.rung_quality.size()) + " rungs of the qualities in textures.json",
                     std::to_string(t.rung_quality.size()) + " rungs");
    const CodecTraits& codec = codec_traits(info.codec);
    findings.require(codec.incremental == t.incremental, {"tables-codec", "R10"}, kTablesPath,
                     plane_field(static_cast<std::uint32_t>(k), "incremental"),
                     codec.incremental ? "set, for codec " + std::string(codec.id) : "not set",
                     "the opposite");
    findings.require(
        codec.required_feature.empty() ||
            std::count(m.required_features.begin(), m.required_features.end(), codec.required_feature) > 0,
        {"textures", "R05"}, kManifestPath, "/requiredFeatures", std::string(codec.required_feature),
        "codec " + std::string(codec.id) + " without it");
    findings.require_equal(sum(t.table_bytes), info.tables.bytes, {"tables-size", "R12"}, info.tables.path,
                           "bytes");
    for (std::size_t r = 0; r < std::min(info.rungs.size(), t.rung_count()); ++r) {
      std::uint64_t bytes = 0;
      for (std::size_t i = 0; i < t.fragment_count(); ++i) bytes += t.size_bytes[r * t.fragment_count() + i];
      findings.require_equal(bytes, info.rungs[r].bytes, {"tables-size", "R13"}, info.rungs[r].path, "bytes");
    }
  }
}

void check_plane_tables(const TextureInfo& texture, std::uint32_t plane, const PlaneTables& t,
                        Findings& findings) {
  check_order(plane, t, findings);
  double surface = 0;
  const std::uint64_t texels =
      static_cast<std::uint64_t>(texture.fragment_width_px) * texture.fragment_height_px;
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    surface += static_cast<double>(t.surface_fraction[i]);
    findings.require(t.covered_texels[i] <= texels, {"tables", "T11"}, kTablesPath,
                     plane_field(plane, "covered texels of fragment " + std::to_string(i)),
                     "at most " + std::to_string(texels), std::to_string(t.covered_texels[i]));
  }
  findings.require(surface <= 1.001, {"tables", "T11"}, kTablesPath, plane_field(plane, "surface"),
                   "at most the whole surface, 1", shortest(surface, 6));
}

void check_preview(const TextureInfo& texture, std::span<const std::uint8_t> jpeg, Findings& findings) {
  try {
    check_jpeg_head(texture.preview.path, "", jpeg, findings);
    const Pixels p = decode_jpeg(jpeg, 1ull << 26);
    findings.require(p.width_px == texture.preview_width_px && p.height_px == texture.preview_height_px &&
                         p.channels == texture.channels,
                     {"preview", "F16"}, texture.preview.path, "",
                     std::to_string(texture.preview_width_px) + " x " +
                         std::to_string(texture.preview_height_px) + " px, " +
                         std::to_string(texture.channels) + " channels",
                     std::to_string(p.width_px) + " x " + std::to_string(p.height_px) + " px, " +
                         std::to_string(p.channels) + " channels");
  } catch (const Error& e) {
    findings.add({"preview", "F16"}, texture.preview.path, e.place(), e.expected(), e.found());
  }
}

void check_source(const TextureInfo& texture, std::vector<std::uint8_t> bytes, Findings& findings) {
  try {
    const Image image = probe_image(texture.source.path, std::move(bytes), {});
    findings.require(image_extension(image.format) == texture.source_extension &&
                         image.width_px == texture.width_px && image.height_px == texture.height_px &&
                         image.channels >= texture.channels,
                     {"source", "O02"}, texture.source.path, "",
                     texture.source_extension + " of " + std::to_string(texture.width_px) + " x " +
                         std::to_string(texture.height_px) + " px",
                     std::string(image_extension(image.format)) + " of " + std::to_string(image.width_px) +
                         " x " + std::to_string(image.height_px) + " px");
    decode_image(image);
  } catch (const Error& e) {
    findings.add({"source", "O02"}, texture.source.path, e.place(), e.expected(), e.found());
  }
}

void check_table_streams(const TextureInfo& texture, const PlaneTables& t, std::span<const std::uint8_t> pack,
                         Findings& findings) {
  if (pack.size() != sum(t.table_bytes)) return;  // check_textures says so
  std::size_t offset = 0;
  std::vector<std::span<const std::uint8_t>> streams;
  for (std::size_t r = 0; r < t.rung_count(); ++r) {
    streams.push_back(pack.subspan(offset, t.table_bytes[r]));
    check_jpeg_head(texture.tables.path, "rung " + std::to_string(r), streams.back(), findings);
    findings.require(
        is_table_stream(texture.codec, static_cast<std::uint32_t>(r), pack.subspan(offset, t.table_bytes[r])),
        {"table-stream", is_baseline(texture.codec) ? "F05" : "F06"}, texture.tables.path,
        "rung " + std::to_string(r),
        "a table stream of " + std::string(codec_traits(texture.codec).id) + " in " +
            std::to_string(t.table_bytes[r]) + " bytes",
        "other bytes");
    offset += t.table_bytes[r];
  }
  if (texture.source_rung) check_source_rung(texture, streams, findings);
}

std::uint64_t check_rung(const TextureInfo& texture, const PlaneTables& t, std::uint32_t rung,
                         const PlaneStreams& streams, const RunContext& context, Findings& findings) {
  std::vector<Findings> per_fragment(t.order.size());
  parallel_for(context, t.order.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      check_fragment(texture, t, rung, t.order[k], streams, per_fragment[k]);
  });
  for (Findings& f : per_fragment) findings.append(std::move(f));
  return t.order.size();
}

}  // namespace texmesh
