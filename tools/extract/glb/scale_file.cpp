#include "tools/extract/glb/scale_file.h"

#include <algorithm>

#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "format/split/split_model.h"
#include "format/split/split_reader.h"
#include "stages/geometry/fit_normals.h"

namespace texmesh {
namespace {

StandaloneGlb stored_file(PackageReader& package, int scale) {
  return {package.scale_glb(scale), mesh_path(scale)};
}

/// The mesh that the stream has at a scale.
Mesh mesh_at(SplitStreamReader& reader, int scale, std::span<const std::uint8_t> stream) {
  const auto& scales = reader.head().scales;
  const auto found = std::ranges::find(scales, scale, &SplitScale::scale);
  if (found == scales.end())
    throw FormatError(kSplitStreamPath, "scales", "scale " + std::to_string(scale), "none");
  reader.read_to_scale(static_cast<std::size_t>(found - scales.begin()), stream);
  return split_model(reader.head(), reader.mesh());
}

void fit_to_finest(const Mesh& finest, Mesh& mesh, const RunContext& context) {
  if (mesh.normals.empty()) return;
  std::vector<Vec3d> points;
  for (const std::uint32_t p : mesh.wedge_position) points.push_back(to_double(mesh.positions[p]));
  mesh.normals =
      fit_normals(points, mesh.triangles, std::move(mesh.normals), normal_samples(finest), context);
}

}  // namespace

StandaloneGlb scale_file(PackageReader& package, int scale, const RunContext& context,
                         StreamedNormals normals) {
  const Manifest& m = package.manifest();
  const ManifestScale& wanted = m.scales[package.scale_index(scale)];
  const int coarsest = m.scales.back().scale;
  StandaloneGlb first = stored_file(package, coarsest);
  if (scale == coarsest) return first;
  if (wanted.has_glb()) {
    StandaloneGlb file = stored_file(package, scale);
    file.set_images(first.images());
    return file;
  }
  const bool fitted = normals == StreamedNormals::kFitted;
  const Bytes stream = fitted ? package.entry(kSplitStreamPath) : package.split_prefix(scale);
  SplitStreamReader reader(read_split_head(stream));
  Mesh mesh = mesh_at(reader, scale, stream);
  if (fitted) fit_to_finest(mesh_at(reader, 0, stream), mesh, context);
  ScalesOptions options;
  options.mesh_codec = first.codec();
  first.take_meshes({write_streamed_scale(mesh, reader.head(), options), mesh_path(scale)});
  return first;
}

}  // namespace texmesh
