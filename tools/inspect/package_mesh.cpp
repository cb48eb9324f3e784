#include "tools/inspect/package_mesh.h"

#include <filesystem>
#include <fstream>

namespace texmesh {
namespace {

/// The files that scale files refer to: "../preview/003.jpg".
class PreviewsOf : public Resolver {
 public:
  explicit PreviewsOf(PackageReader& package) : package_(package) {}
  std::optional<std::vector<std::uint8_t>> read(const std::string& uri, std::uint64_t) override {
    for (std::uint32_t p = 0; p < package_.textures().size(); ++p)
      if (uri == "../" + preview_path(p)) return package_.preview(p);
    return std::nullopt;
  }

 private:
  PackageReader& package_;
};

}  // namespace

bool is_package(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ec;
  if (fs::is_directory(path, ec)) return fs::exists(fs::path(path) / kManifestPath, ec);
  std::ifstream in(path, std::ios::binary);
  char magic[4]{};
  in.read(magic, 4);
  return in.gcount() == 4 && std::equal(magic, magic + 4, "PK\x03\x04");
}

ImportedModel finest_scale(PackageReader& package, const RunContext& context) {
  PreviewsOf previews(package);
  return import_package_glb(mesh_path(0), package.scale_glb(0), previews, context);
}

std::int32_t plane_of_image(const std::vector<TextureInfo>& textures, const std::string& name) {
  for (std::size_t p = 0; p < textures.size(); ++p)
    if (std::to_string(textures[p].image) == name ||
        preview_path(static_cast<std::uint32_t>(p)).ends_with("/" + name))
      return static_cast<std::int32_t>(p);
  return -1;
}

}  // namespace texmesh
