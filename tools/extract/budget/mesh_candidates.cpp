#include "tools/extract/budget/mesh_candidates.h"

#include <algorithm>

#include "format/base/portable_math.h"
#include "format/container/layout.h"
#include "pipeline/about/gltf_about.h"
#include "tools/extract/budget/budget_search.h"
#include "tools/extract/glb/scale_file.h"

namespace texmesh {
namespace {

/// Bits per coordinate along the longest side of the object, of texture coordinates along the image, of
/// normals and vertex colours; for pictures 512 px high.
struct Coding {
  int position, uv, normal, colour;
};
constexpr Coding kCodings[kMeshCodings] = {{10, 10, 7, 5}, {11, 11, 7, 6}, {12, 12, 8, 7},
                                           {13, 13, 8, 8}, {14, 14, 9, 8}, {15, 14, 11, 8}};

}  // namespace

std::vector<std::uint8_t> MeshCandidate::file_with(
    const std::map<std::uint32_t, FileImageData>& images) const {
  StandaloneGlb out = *file;
  std::map<std::uint32_t, FileImageData> all;
  for (const std::uint32_t i : out.source_images()) all[i] = {FileImage::kWebp, {}};
  for (const auto& [i, data] : images) all[i] = data;
  out.set_images(all);
  return out.finish();
}

DracoSteps MeshCandidates::steps_of(const MeshKey& key) const {
  const Coding& c = kCodings[key.coding];
  int finer = 0;  // a picture twice as high shows one bit more
  for (double px = 512 * 1.5; px < source_.display_px && finer < 4; px *= 2) ++finer;
  const auto places = [&](int bits) {
    return portable::exp(portable::log(2) * (bits + finer + key.extra_bits));
  };
  return {source_.extent / places(c.position), 1 / places(c.uv), c.normal, c.colour, key.extra_bits != 0};
}

std::unique_ptr<StandaloneGlb> MeshCandidates::recoded_scale(int scale, const MeshKey& key) const {
  auto file = std::make_unique<StandaloneGlb>(
      scale_file(source_.package, scale, source_.context, StreamedNormals::kStreamed));
  const bool lit_anew = scale > 0 && !source_.light.places.empty();
  if (file->has_draco() && (lit_anew || key.coding + 1 < kMeshCodings || key.extra_bits < 0))
    file->recode(steps_of(key), lit_anew ? &source_.light : nullptr, source_.context);
  return file;
}

int MeshCandidates::scale_of(const MeshKey& key) const {
  return source_.package.manifest().scales[key.scale].scale;
}

std::vector<int> MeshCandidates::levels(const MeshKey& key) const {
  if (!source_.request.lods) return {scale_of(key)};
  return levels_of(source_.package.manifest(), scale_of(key));
}

std::unique_ptr<LitMesh> MeshCandidates::lit_mesh(const StandaloneGlb& file, const MeshKey& key) const {
  Model model = read_model(file, mesh_path(scale_of(key)), source_.context);
  return std::make_unique<LitMesh>(source_.lit_mesh(model));
}

const MeshCandidates::Shape& MeshCandidates::shape(const MeshKey& key) {
  const auto [it, fresh] = shapes_.try_emplace(key);
  Shape& s = it->second;
  if (!fresh) return s;
  const Manifest& m = source_.package.manifest();
  const std::vector<int> all = levels(key);
  std::unique_ptr<StandaloneGlb> file = recoded_scale(all[0], key);
  s.mesh = lit_mesh(*file, key);
  if (source_.request.lods) file->begin_levels(screen_coverage_of(m, all[0]));
  for (std::size_t l = 1; l < all.size(); ++l)
    file->add_level(*recoded_scale(all[l], key), screen_coverage_of(m, all[l]));
  if (!source_.request.recentre) file->move_to(m.origin);
  s.file = std::move(file);
  const LitViews windows(*s.mesh, source_.windows, source_.context);
  s.geometry = source_.window_meter->difference(windows, source_.best_textures, source_.context);
  return s;
}

const MeshCandidate& MeshCandidates::at(const MeshKey& key) {
  const auto [it, fresh] = made_.try_emplace(key);
  MeshCandidate& c = it->second;
  if (!fresh) return c;
  const Shape& s = shape(key);
  c.scale = scale_of(key);
  c.levels = levels(key);
  c.triangles = source_.package.manifest().scales[key.scale].triangles;
  c.geometry = s.geometry;
  auto file = std::make_shared<StandaloneGlb>(*s.file);
  file->set_about(about_within(source_.package.about(), source_.request.bytes / kAboutShare));
  c.file = std::move(file);
  c.fixed_bytes = c.file_with({}).size();
  return c;
}

const LitMesh& MeshCandidates::mesh(const MeshKey& key) {
  shape(key);
  Shape& s = shapes_.at(key);
  if (!s.mesh) s.mesh = lit_mesh(*recoded_scale(scale_of(key), key), key);
  return *s.mesh;
}

void MeshCandidates::forget(const MeshKey& key) {
  made_.erase(key);
  const auto it = shapes_.find(key);
  if (it == shapes_.end()) return;
  if (for_several_)
    it->second.mesh.reset();
  else
    shapes_.erase(it);
}

void MeshCandidates::forget_all() {
  made_.clear();
  for (auto& [key, shape] : shapes_) shape.mesh.reset();
}

}  // namespace texmesh
