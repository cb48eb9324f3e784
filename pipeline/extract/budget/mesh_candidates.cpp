#include "pipeline/extract/budget/mesh_candidates.h"

#include <algorithm>

#include "format/base/portable_math.h"
#include "format/container/layout.h"
#include "pipeline/about/gltf_about.h"
#include "pipeline/extract/budget/budget_search.h"
#include "pipeline/extract/glb/scale_file.h"

namespace texmesh {
namespace {

/// Bits per coordinate along the longest side of the object, of texture coordinates along the image, of
/// normals and vertex colours; for pictures 512 px high.
struct Coding {
  int position, uv, normal, colour;
};
constexpr Coding kCodings[kMeshCodings] = {
    {10, 10, 7, 5}, {11, 11, 7, 6}, {12, 12, 8, 7}, {13, 13, 8, 8}, {14, 14, 9, 8}};

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

const MeshCandidate& MeshCandidates::at(const MeshKey& key) {
  const auto [it, fresh] = made_.try_emplace(key);
  MeshCandidate& c = it->second;
  if (!fresh) return c;
  const Manifest& m = source_.package.manifest();
  c.scale = m.scales[key.scale].scale;
  c.triangles = m.scales[key.scale].triangles;
  c.levels = source_.request.lods ? levels_of(m, c.scale) : std::vector<int>{c.scale};
  std::unique_ptr<StandaloneGlb> file = recoded_scale(c.scale, key);
  Model model = read_model(*file, mesh_path(c.scale), source_.context);
  c.mesh = source_.lit_mesh(model);
  if (source_.request.lods) file->begin_levels(screen_coverage_of(m, c.scale));
  for (std::size_t l = 1; l < c.levels.size(); ++l)
    file->add_level(*recoded_scale(c.levels[l], key), screen_coverage_of(m, c.levels[l]));
  if (!source_.request.recentre) file->move_to(m.origin);
  file->set_about(about_within(source_.package.about(), source_.request.bytes / kAboutShare));
  c.file = std::move(file);
  c.fixed_bytes = c.file_with({}).size();
  c.windows = std::make_unique<LitViews>(c.mesh, source_.windows, source_.context);
  c.geometry = source_.window_meter->difference(*c.windows, source_.best_textures, source_.context);
  return c;
}

}  // namespace texmesh
