// Computes the studio's environment while the library is built, and prints it as C++.
#include <bit>
#include <cstdio>

#include "stages/render/environment.h"

int main() {
  std::puts(
      "// Made by make_studio_table.\n#include <cstdint>\n#include <span>\n\nnamespace texmesh {\n"
      "namespace {\n\nconstexpr std::uint32_t kStudioWords[] = {");
  int column = 0;
  const auto put = [&](std::uint32_t word) {
    std::printf("0x%08x,%c", word, ++column % 8 == 0 ? '\n' : ' ');
  };
  const auto put_colour = [&](texmesh::Vec3f c) {
    for (int k = 0; k < 3; ++k) put(std::bit_cast<std::uint32_t>(c[k]));
  };
  const texmesh::RenderEnvironment studio =
      texmesh::prepare_environment(texmesh::studio_radiance, texmesh::studio_key_light(), {});
  for (const texmesh::Vec4f c : studio.irradiance) put_colour({c.x, c.y, c.z});
  for (const auto& level : studio.levels) {
    put(level.side);
    for (const texmesh::Vec4f c : level.texels) put_colour({c.x, c.y, c.z});
  }
  std::puts(
      "};\n\n}  // namespace\n\nstd::span<const std::uint32_t> studio_table() { return kStudioWords; }\n\n"
      "}  // namespace texmesh");
}
