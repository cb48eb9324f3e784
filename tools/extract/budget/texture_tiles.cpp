#include "tools/extract/budget/texture_tiles.h"

#include <cmath>

#include "stages/geometry/texel_coverage.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kSamplePx = 32;
constexpr double kSampleTexels = 262144;  // a whole file of so many takes as little time
constexpr double kJpegHeadBytes = 600;    // of a JPEG, its tables
constexpr std::uint32_t kTileLevels = 4;  // a tile is a texel there

float folded(float u, Wrap wrap) {
  if (!std::isfinite(u)) return 0;
  if (wrap == Wrap::kClamp) return std::clamp(u, 0.f, 1.f);
  if (wrap == Wrap::kRepeat) return u - std::floor(u);
  const float t = u - 2 * std::floor(u / 2);
  return t > 1 ? 2 - t : t;
}

std::uint32_t tiles_across(std::size_t tiles) {
  return static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(tiles))));
}

/// Copies a square of `side` texels.
void copy_square(const Pixels& from, std::uint32_t from_x, std::uint32_t from_y, std::uint32_t side,
                 std::uint32_t to_x, std::uint32_t to_y, Pixels& to) {
  const std::size_t bytes = std::size_t{side} * from.channels;
  for (std::uint32_t y = 0; y < side; ++y)
    std::copy_n(from.at(from_x, from_y + y), bytes,
                to.data.data() + (std::size_t{to_y + y} * to.width_px + to_x) * to.channels);
}

}  // namespace

std::vector<Vec2f> places_read(const LitViews& windows, const std::vector<PictureTexture>& shown,
                               std::size_t image) {
  const LitMesh& lit = windows.mesh();
  std::vector<Vec2f> out;
  for (std::size_t v = 0; v < windows.count(); ++v)
    for (const RenderFragment& f : windows.visibility(v).fragments)
      for (const TextureSlot& slot : lit.materials[lit.mesh.triangle_material[f.triangle]].textures) {
        if (slot.texture < 0 || shown[static_cast<std::size_t>(slot.texture)].image != image) continue;
        const std::vector<Vec2f>& uv = slot.uv_set == 0 ? lit.mesh.uv0 : lit.mesh.uv1;
        const Triangle& t = lit.mesh.triangles[f.triangle];
        const Vec2f at =
            uv_matrix(slot.transform)
                .place(uv[t[0]] * (1 - f.weight1 - f.weight2) + uv[t[1]] * f.weight1 + uv[t[2]] * f.weight2);
        out.push_back({folded(at.x, slot.wrap_s), folded(at.y, slot.wrap_t)});
      }
  return out;
}

bool TextureTiles::suits(std::uint32_t width_px, std::uint32_t height_px) {
  return width_px % kTilePx == 0 && height_px % kTilePx == 0 && width_px >= kSamplePx &&
         height_px >= kSamplePx && static_cast<double>(width_px) * height_px > kSampleTexels;
}

TextureTiles::TextureTiles(const Pixels& image, const std::vector<std::uint8_t>& coverage,
                           const std::vector<Vec2f>& places, double reach_px, const RunContext& context)
    : image_(image) {
  find_tiles(places, reach_px);
  read_tiles_ = picture_of(tiles_, kTilePx, coverage, PartBlocks::kSmooth, context);
  const std::vector<Tile> spread = spread_tiles();
  sample_ = picture_of(spread, kSamplePx, coverage, PartBlocks::kSparse, context);
  sampled_ = static_cast<double>(spread.size()) * kSamplePx * kSamplePx /
             (static_cast<double>(image.width_px) * image.height_px);
}

void TextureTiles::find_tiles(const std::vector<Vec2f>& places, double reach_px) {
  const std::uint32_t columns = image_.width_px / kTilePx, rows = image_.height_px / kTilePx;
  std::vector<std::uint8_t> read(std::size_t{columns} * rows, 0);
  const auto tile_at = [](double texel, std::uint32_t count) {
    return static_cast<std::uint32_t>(std::clamp(texel / kTilePx, 0.0, count - 1.0));
  };
  for (const Vec2f place : places) {
    const double x = static_cast<double>(place.x) * image_.width_px,
                 y = static_cast<double>(place.y) * image_.height_px;
    for (std::uint32_t r = tile_at(y - reach_px, rows); r <= tile_at(y + reach_px, rows); ++r)
      for (std::uint32_t c = tile_at(x - reach_px, columns); c <= tile_at(x + reach_px, columns); ++c)
        read[std::size_t{r} * columns + c] = 1;
  }
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c)
      if (read[std::size_t{r} * columns + c]) tiles_.push_back({c, r});
  if (tiles_.empty()) tiles_.push_back({0, 0});
}

/// By Roberts' sequence, whose places in the unit square are spread evenly.
std::vector<TextureTiles::Tile> TextureTiles::spread_tiles() const {
  const std::uint32_t columns = image_.width_px / kSamplePx, rows = image_.height_px / kSamplePx;
  const double part = kSampleTexels / (static_cast<double>(image_.width_px) * image_.height_px);
  std::vector<Tile> out;
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) {
      const double place = 0.7548776662466927 * c + 0.5698402909980532 * r;
      if (place - std::floor(place) < part) out.push_back({c, r});
    }
  if (out.empty()) out.push_back({columns / 2, rows / 2});
  return out;
}

Pixels TextureTiles::picture_of(const std::vector<Tile>& tiles, std::uint32_t side_px,
                                const std::vector<std::uint8_t>& coverage, PartBlocks part,
                                const RunContext& context) const {
  const std::uint32_t across = tiles_across(tiles.size());
  const auto down = static_cast<std::uint32_t>((tiles.size() + across - 1) / across);
  Pixels out{across * side_px, down * side_px, image_.channels, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * out.channels, 128);
  std::vector<std::uint8_t> covered(coverage_size_bytes(out.width_px, out.height_px));
  const std::size_t from_stride = coverage_stride_bytes(image_.width_px),
                    to_stride = coverage_stride_bytes(out.width_px), bytes = side_px / 8;
  for (std::uint32_t k = 0; k < tiles.size(); ++k) {
    const std::uint32_t x = k % across, y = k / across * side_px;
    copy_square(image_, tiles[k].x * side_px, tiles[k].y * side_px, side_px, x * side_px, y, out);
    for (std::uint32_t row = 0; row < side_px && !coverage.empty(); ++row)
      std::copy_n(coverage.data() + (tiles[k].y * side_px + row) * from_stride + tiles[k].x * bytes, bytes,
                  covered.data() + (y + row) * to_stride + x * bytes);
  }
  if (!coverage.empty()) fill_uncovered(out, covered, context, part);
  return out;
}

double TextureTiles::file_bytes(std::size_t sample_bytes) const {
  return kJpegHeadBytes + std::max(static_cast<double>(sample_bytes) - kJpegHeadBytes, 0.0) / sampled_;
}

void TextureTiles::prepare(bool srgb, std::uint32_t first_level, const RunContext& context) {
  whole_[srgb] = render_texture(image_, srgb, first_level, context);
}

RenderTexture TextureTiles::texture_with(Pixels tiles, bool srgb, const RunContext& context) const {
  RenderTexture out = whole_.at(srgb);
  const std::uint32_t across = tiles_across(tiles_.size());
  Pixels level = coarser_level(std::move(tiles), srgb, out.first_level, context);
  for (std::uint32_t l = out.first_level; l <= kTileLevels; ++l) {
    const std::uint32_t side = kTilePx >> l;
    for (std::uint32_t k = 0; k < tiles_.size(); ++k)
      copy_square(level, k % across * side, k / across * side, side, tiles_[k].x * side, tiles_[k].y * side,
                  out.levels[l - out.first_level]);
    if (l < kTileLevels) level = coarser_level(std::move(level), srgb, 1, context);
  }
  return out;
}

}  // namespace texmesh
