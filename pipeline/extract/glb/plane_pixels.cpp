#include "pipeline/extract/glb/plane_pixels.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "delivery/cpp/package/plane_streams.h"
#include "format/base/errors.h"
#include "format/container/layout.h"
#include "stages/base/parallel.h"
#include "stages/data/coverage.h"
#include "stages/fill/fill.h"
#include "stages/fragment_codec/fragment_codec.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMaxPixels = 400'000'000;

/// Copies what of a fragment lies within the plane.
void place(const Pixels& fragment, const TextureInfo& info, std::uint32_t index, Pixels& plane) {
  const std::uint32_t x = index % info.columns * info.fragment_width_px;
  const std::uint32_t y = index / info.columns * info.fragment_height_px;
  if (x >= plane.width_px || y >= plane.height_px) return;
  const std::uint32_t width = std::min(fragment.width_px, plane.width_px - x),
                      height = std::min(fragment.height_px, plane.height_px - y);
  for (std::uint32_t row = 0; row < height; ++row)
    std::memcpy(plane.data.data() + (std::size_t{y + row} * plane.width_px + x) * plane.channels,
                fragment.at(0, row), std::size_t{width} * plane.channels);
}

void require_fragment(const Pixels& pixels, const TextureInfo& info, const std::string& path,
                      std::uint32_t fragment) {
  if (pixels.width_px == info.fragment_width_px && pixels.height_px == info.fragment_height_px &&
      pixels.channels == info.channels)
    return;
  throw FormatError(path, "fragment " + std::to_string(fragment),
                    std::to_string(info.fragment_width_px) + " x " + std::to_string(info.fragment_height_px) +
                        " px, " + std::to_string(info.channels) + " channels",
                    std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px) + " px, " +
                        std::to_string(pixels.channels) + " channels");
}

/// Coverage bits (TexturePlane::coverage) of the texels that some fragment has given.
std::vector<std::uint8_t> known_texels(const TextureInfo& info, const std::vector<bool>& known) {
  const std::size_t stride = coverage_stride_bytes(info.width_px);
  std::vector<std::uint8_t> bits(stride * info.height_px);
  for (std::uint32_t y = 0; y < info.height_px; ++y)
    for (std::uint32_t x = 0; x < info.width_px; ++x)
      if (known[std::size_t{y / info.fragment_height_px} * info.columns + x / info.fragment_width_px])
        bits[y * stride + x / 8] = static_cast<std::uint8_t>(bits[y * stride + x / 8] | 0x80 >> x % 8);
  return bits;
}

}  // namespace

Pixels read_plane(PackageReader& package, std::uint32_t plane, std::uint32_t rung,
                  const RunContext& context) {
  const TextureInfo& info = package.textures().at(plane);
  const PlaneTables& tables = package.tables().planes.at(plane);
  if (std::uint64_t{info.width_px} * info.height_px > kMaxPixels)
    throw FormatError(kTexturesPath, "/textures/" + std::to_string(plane),
                      "at most " + std::to_string(kMaxPixels) + " texels",
                      std::to_string(info.width_px) + " x " + std::to_string(info.height_px));
  const auto top = static_cast<std::uint32_t>(std::min<std::size_t>(rung, tables.rung_count() - 1));
  PlaneStreams streams(info.codec, tables, package.entry(info.tables));
  for (std::uint32_t r = codec_traits(info.codec).incremental ? 0 : top; r <= top; ++r)
    streams.add_pack(r, package.entry(info.rungs[r]));

  Pixels out{info.width_px, info.height_px, info.channels, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * out.channels);
  const std::uint64_t fragment_pixels = std::uint64_t{info.fragment_width_px} * info.fragment_height_px;
  std::vector<bool> known(tables.fragment_count());
  for (const std::uint16_t f : tables.order) known[f] = !streams.stream(f).empty();
  parallel_for(context, tables.order.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint16_t f = tables.order[k];
      if (!known[f]) continue;
      const Pixels pixels = decode_fragment_file(info.codec, streams.file(f), fragment_pixels);
      require_fragment(pixels, info, info.rungs[top].path, f);
      place(pixels, info, f, out);
    }
  });
  if (std::find(known.begin(), known.end(), false) != known.end())
    fill_uncovered(out, known_texels(info, known), context);
  return out;
}

void require_rung(PackageReader& package, std::uint32_t rung) {
  if (rung == kBestRung || package.tables().planes.empty()) return;
  std::size_t most = 0;
  for (const PlaneTables& t : package.tables().planes) most = std::max(most, t.rung_count());
  if (rung >= most)
    throw InputError(package.store().name(), "rung " + std::to_string(rung),
                     "0 to " + std::to_string(most - 1) + ", or max", "another");
}

}  // namespace texmesh
