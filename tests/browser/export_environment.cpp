// export_environment OUT.f32 WIDTH: the light of all measurements for other renderers. OUT gets WIDTH x WIDTH
// / 2 texels of RGBA floats, an equirectangular picture as three.js reads it: rows from below, the middle
// column towards +X. Standard output gets the key light as JSON.
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <vector>

#include "stages/render/environment.h"

namespace texmesh {
namespace {

std::vector<float> equirectangular(std::uint32_t width, std::uint32_t height) {
  std::vector<float> out;
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      const double elevation = M_PI * ((y + 0.5) / height - 0.5), turn = 2 * M_PI * ((x + 0.5) / width - 0.5);
      const Vec3f light = studio_radiance(to_float(Vec3d{
          std::cos(elevation) * std::cos(turn), std::sin(elevation), std::cos(elevation) * std::sin(turn)}));
      out.insert(out.end(), {light.x, light.y, light.z, 1.f});
    }
  return out;
}

nlohmann::json json_of(Vec3f v) { return nlohmann::json::array({v.x, v.y, v.z}); }

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  const int width = argc == 3 ? std::atoi(argv[2]) : 0;
  if (width < 2) {
    std::cerr << "usage: export_environment OUT.f32 WIDTH\n";
    return 2;
  }
  const auto side = static_cast<std::uint32_t>(width);
  const std::vector<float> texels = texmesh::equirectangular(side, side / 2);
  std::ofstream(argv[1], std::ios::binary)
      .write(reinterpret_cast<const char*>(texels.data()),
             static_cast<std::streamsize>(texels.size() * sizeof(float)));
  const texmesh::KeyLight key = texmesh::studio_key_light();
  std::cout << nlohmann::json{{"widthPx", side},
                              {"heightPx", side / 2},
                              {"towards", texmesh::json_of(key.towards)},
                              {"irradiance", texmesh::json_of(key.irradiance)}}
            << '\n';
}
