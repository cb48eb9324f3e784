#include <cstdio>

#include "delivery/cpp/package/package_reader.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  texmesh::PackageReader package(texmesh::open_store(argv[1]));
  const int scale = texmesh::select_scale(package.manifest(), 100);
  const bool has_glb = package.manifest().scales[package.scale_index(scale)].has_glb();
  std::printf("%zu scales, %zu bytes for 100 px, %zu rungs\n", package.manifest().scales.size(),
              (has_glb ? package.scale_glb(scale) : package.split_prefix(scale)).size(),
              package.textures().at(0).rungs.size());
  return package.textures().at(0).rungs.size() == 4 ? 0 : 1;
}
