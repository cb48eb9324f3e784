#include "tools/render/plane_pixels.h"

#include "delivery/cpp/package/package_reader.h"
#include "stages/base/parallel.h"
#include "stages/fill/fill.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/measure/fragment_meter.h"

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

void require_size(const TextureInfo& info, std::uint32_t plane) {
  if (std::uint64_t{info.width_px} * info.height_px > kMaxPixels)
    throw FormatError(kTexturesPath, "/textures/" + std::to_string(plane),
                      "at most " + std::to_string(kMaxPixels) + " texels",
                      std::to_string(info.width_px) + " x " + std::to_string(info.height_px));
}

/// The preview of a full-size plane at the size of `info`.
Pixels enlarged_preview(PackageReader& package, std::uint32_t base, const TextureInfo& info) {
  const Pixels preview =
      decode_image(probe_image(package.textures().at(base).preview.path, package.preview(base), {}));
  SamplePatch patch{{0, 0, preview.width_px, preview.height_px}, Samples(info.channels)};
  for (std::size_t c = 0; c < info.channels; ++c)
    for (std::size_t i = 0; i < std::size_t{preview.width_px} * preview.height_px; ++i)
      patch.samples[c].push_back(
          preview.data[i * preview.channels + std::min<std::size_t>(c, preview.channels - 1)]);
  const Samples large = scaled_up(patch, bilinear_places(0, info.width_px, info.width_px, preview.width_px),
                                  bilinear_places(0, info.height_px, info.height_px, preview.height_px));
  Pixels out{info.width_px, info.height_px, info.channels, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * out.channels);
  for (std::size_t c = 0; c < info.channels; ++c)
    for (std::size_t i = 0; i < large[c].size(); ++i) out.data[i * info.channels + c] = large[c][i];
  return out;
}

}  // namespace

Pixels read_shown_plane(PackageReader& package, std::uint32_t base, std::uint32_t plane,
                        std::span<const std::int32_t> rungs, const RunContext& context) {
  const TextureInfo& info = package.textures().at(plane);
  const PlaneTables& tables = package.tables().planes.at(plane);
  require_size(info, plane);
  if (rungs.size() != tables.fragment_count())
    throw std::invalid_argument("read_shown_plane: a rung for each fragment");
  const std::uint64_t fragment_pixels = std::uint64_t{info.fragment_width_px} * info.fragment_height_px;
  Pixels out = enlarged_preview(package, base, info);
  PlaneStreams streams(info.codec, tables, package.entry(info.tables));
  for (std::uint32_t r = 0; r < tables.rung_count(); ++r) {
    std::vector<std::uint16_t> shown;
    for (const std::uint16_t f : tables.order)
      if (rungs[f] == static_cast<std::int32_t>(r)) shown.push_back(f);
    if (shown.empty() && !codec_traits(info.codec).incremental) continue;
    streams.add_pack(r, package.entry(info.rungs[r]));
    parallel_for(context, shown.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        if (streams.stream(shown[k]).empty()) continue;
        const Pixels pixels = decode_fragment_file(info.codec, streams.file(shown[k]), fragment_pixels);
        require_fragment(pixels, info, info.rungs[r].path, shown[k]);
        place(pixels, info, shown[k], out);
      }
    });
  }
  return out;
}

Pixels read_plane(PackageReader& package, std::uint32_t plane, std::uint32_t rung,
                  const RunContext& context) {
  const TextureInfo& info = package.textures().at(plane);
  const PlaneTables& tables = package.tables().planes.at(plane);
  require_size(info, plane);
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
