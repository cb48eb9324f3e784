#include "tools/publish/report/picture_row.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/io/markup.h"
#include "stages/image/png_writer.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"
#include "tools/publish/report/flip_colours.h"
#include "tools/publish/report/html.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kMargin = 6;  // px around the object
constexpr int kMostEnlarged = 6;

struct Rectangle {
  std::uint32_t left = 0, top = 0, right = 0, bottom = 0;  // right and bottom are outside
};

/// What either picture shows with its margin; all where they show nothing.
Rectangle shown_part(const Picture& a, const Picture& b) {
  const std::uint32_t side = a.side_px;
  Rectangle r{side, side, 0, 0};
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::size_t i = std::size_t{y} * side + x;
      if (!a.covered[i] && !b.covered[i]) continue;
      r = {std::min(r.left, x), std::min(r.top, y), std::max(r.right, x + 1), std::max(r.bottom, y + 1)};
    }
  if (r.left >= r.right) return {0, 0, side, side};
  return {r.left - std::min(r.left, kMargin), r.top - std::min(r.top, kMargin),
          std::min(r.right + kMargin, side), std::min(r.bottom + kMargin, side)};
}

Pixels cut(const Pixels& pixels, const Rectangle& r) {
  Pixels out{r.right - r.left, r.bottom - r.top, pixels.channels, {}};
  for (std::uint32_t y = r.top; y < r.bottom; ++y) {
    const std::uint8_t* row = pixels.at(r.left, y);
    out.data.insert(out.data.end(), row, row + std::size_t{out.width_px} * pixels.channels);
  }
  return out;
}

}  // namespace

std::string picture_row(const PictureRow& row, const Picture& reference, const Picture& tested,
                        std::vector<ReportFile>& files) {
  const Rectangle part = shown_part(reference, tested);
  const FlipPicture a = prepare_flip(reference), b = prepare_flip(tested);
  const Pixels heat = heat_picture(flip_map(a, b), reference.side_px, kFullHeat);
  const std::uint32_t width = part.right - part.left, height = part.bottom - part.top;
  const int times =
      std::clamp(static_cast<int>(row.enlarge_to_px / static_cast<double>(width)), 1, kMostEnlarged);
  std::string out = "<div class=\"row\">\n";
  const auto add = [&](const std::string& ending, const std::string& name, const std::string& alt,
                       const Pixels& pixels) {
    files.push_back({row.name + ending + ".png", write_png(cut(pixels, part))});
    out += fmt::format(
        "<div><p class=\"quiet\">{}</p><img{} src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"></div>\n",
        name, times > 1 ? " class=\"enlarged\"" : "", markup_escaped(files.back().path),
        width * static_cast<std::uint32_t>(times), height * static_cast<std::uint32_t>(times),
        markup_escaped(alt));
  };
  add("-reference", row.reference_name, row.alt + ", the reference", encode_srgb(reference));
  add("-tested", row.tested_name, row.alt, encode_srgb(tested));
  add("-flip", "FLIP map", row.alt + ": map of the differences", heat);
  return out + "</div>\n";
}

}  // namespace texmesh
