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
  // Any other ZIP archive may hold a model.
  constexpr std::size_t kNameAt = 30;
  std::string head(kNameAt + std::strlen(kManifestPath), '\0');
  std::ifstream in(path, std::ios::binary);
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  return head.starts_with("PK\3\4") && (head.ends_with(kManifestPath) || path.ends_with(".texmesh"));
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
