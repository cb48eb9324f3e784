// compose_plane PACKAGE PLANE QUALITY OUT.png: a texture plane put together from its fragments, each at the
// highest rung up to QUALITY, or the lowest; transparent where no fragment is stored. What the browser's
// texture is compared with.
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "delivery/cpp/package/package_reader.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"

namespace texmesh {
namespace {

std::uint32_t rung_for(const TextureInfo& info, int quality) {
  std::uint32_t rung = 0;
  while (rung + 1 < info.rung_quality.size() && info.rung_quality[rung + 1] <= quality) ++rung;
  return rung;
}

/// Copies a fragment's pixels into RGBA, whatever the number of channels.
void paste(const Pixels& from, const TextureInfo& info, std::uint32_t fragment, Pixels& rgba) {
  const std::uint32_t x0 = fragment % info.columns * info.fragment_width_px;
  const std::uint32_t y0 = fragment / info.columns * info.fragment_height_px;
  for (std::uint32_t y = 0; y < info.fragment_height_px && y0 + y < info.height_px; ++y)
    for (std::uint32_t x = 0; x < info.fragment_width_px && x0 + x < info.width_px; ++x) {
      const std::uint8_t* source = from.at(x, y);
      std::uint8_t* to = &rgba.data[(std::size_t{y0 + y} * info.width_px + x0 + x) * 4];
      for (int c = 0; c < 3; ++c) to[c] = source[from.channels >= 3 ? c : 0];
      to[3] = 255;
    }
}

void compose(const std::string& package_path, std::uint32_t plane, int quality, const std::string& out) {
  PackageReader package(open_store(package_path));
  const TextureInfo& info = package.textures().at(plane);
  const std::uint32_t rung = rung_for(info, quality);
  Pixels rgba{info.width_px, info.height_px, 4, {}};
  rgba.data.resize(std::size_t{info.width_px} * info.height_px * 4);
  for (std::uint32_t f = 0; f < info.columns * info.rows; ++f) {
    if (package.fragment_range(plane, rung, f).bytes == 0) continue;
    const Image file = probe_image("fragment", package.complete_fragment(plane, rung, f), ImageLimits{});
    paste(decode_image(file), info, f, rgba);
  }
  const auto png = write_png(rgba);
  std::ofstream(out, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  if (argc != 5) {
    std::cerr << "usage: compose_plane PACKAGE PLANE QUALITY OUT.png\n";
    return 2;
  }
  try {
    texmesh::compose(argv[1], static_cast<std::uint32_t>(std::atoi(argv[2])), std::atoi(argv[3]), argv[4]);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
