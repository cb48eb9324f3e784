// What the standalone scales of a package cost, and of what: packages as arguments. The last column is the
// sum over all kept scales as a multiple of S_0's mesh bytes, which with the codec draco are those of
// one-shot Draco at the same quantisation; target <= 2.5 on the turtle, the bust and the saxophone.
//   texmesh compile turtle.glb -o turtle.texmesh && scales_bench turtle.texmesh
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/rules/allocation.h"

namespace texmesh {
namespace {

struct Bytes {
  std::size_t file = 0, json = 0, images = 0;
  std::size_t mesh() const { return file - json - images; }
  void operator+=(const Bytes& b) { file += b.file, json += b.json, images += b.images; }
};

Bytes bytes_of(const std::vector<std::uint8_t>& glb) {
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  const nlohmann::json json =
      nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(length));
  Bytes b{glb.size(), length, 0};
  for (const auto& image : json.value("images", nlohmann::json::array()))
    b.images += json["bufferViews"][image["bufferView"].get<std::size_t>()]["byteLength"].get<std::size_t>();
  return b;
}

void print(const char* path) {
  PackageReader reader(open_store(path));
  std::printf("%s\n%6s %10s %10s %10s %10s %10s %8s\n", path, "scale", "triangles", "file", "mesh",
              "previews", "JSON", "B/tri");
  Bytes sum, finest;
  for (const auto& scale : reader.manifest().scales) {
    if (!scale.has_glb()) continue;  // the stream alone has it
    const Bytes b = bytes_of(reader.scale_glb(scale.scale));
    if (scale.scale == 0) finest = b;
    sum += b;
    std::printf("%6d %10u %10zu %10zu %10zu %10zu %8.2f\n", scale.scale,
                static_cast<unsigned>(scale.triangles), b.file, b.mesh(), b.images, b.json,
                static_cast<double>(b.mesh()) / scale.triangles);
  }
  const double one_shot = static_cast<double>(finest.mesh());
  std::printf("   sum            %10zu %10zu %10zu %10zu\n", sum.file, sum.mesh(), sum.images, sum.json);
  std::printf("   times S_0's mesh: files %.2f, meshes alone %.2f\n",
              static_cast<double>(sum.file) / one_shot, static_cast<double>(sum.mesh()) / one_shot);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: scales_bench PACKAGE...\n");
    return 2;
  }
  try {
    for (int i = 1; i < argc; ++i) texmesh::print(argv[i]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "scales_bench: %s\n", e.what());
    return 1;
  }
  return 0;
}
