#include <algorithm>

#include "stages/image/jpeg_segments.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

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

}  // namespace

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

}  // namespace texmesh
