#include "pipeline/extract/budget/budget_search.h"

#include <algorithm>
#include <map>
#include <set>

#include "pipeline/extract/budget/budget_file.h"
#include "pipeline/extract/budget/budget_source.h"
#include "pipeline/extract/budget/colour_textures.h"
#include "pipeline/extract/budget/mesh_candidates.h"

namespace texmesh {
namespace {

constexpr int kFirstCoding = 2;
constexpr double kWorthALook = 1.1;  // times the least difference, by the textures of the best file so far
constexpr double kNothing = 1e9;
constexpr double kUsualBytes = 3.5, kLeastBytes = 1.5;  // of a coded triangle

/// Scale, coding of the mesh and textures, chosen together by what files look like.
class BudgetSearch {
 public:
  BudgetSearch(PackageReader& package, const ExtractRequest& request, const RunContext& context)
      : source_(package, request, context),
        meshes_(source_),
        colours_(source_, request),
        filler_(source_, colours_) {}

  Extracted run() {
    const MeshKey best = choose_mesh();
    if (!points_.count(best)) look_closely(best);
    const MeshCandidate& mesh = meshes_.at(best);
    const TexturePoint& point = points_.at(best);
    return finish(mesh, source_.colours.empty()
                            ? point
                            : colours_.best_of_other_codings(mesh, colour_bytes(source_, mesh), point));
  }

 private:
  const std::vector<ManifestScale>& scales() const { return source_.package.manifest().scales; }

  /// From a likely mesh to its neighbours: finer, coarser, coded finer and leaner, and a finer one
  /// coded leaner or the other way round, as long as the picture gets better; one that does not is
  /// passed over once.
  MeshKey choose_mesh() {
    best_ = {source_.request.scale ? source_.package.scale_index(*source_.request.scale) : likely_scale(),
             kFirstCoding};
    least_ = look_closely(best_);
    for (bool again = true; again;) {
      const MeshKey before = best_;
      if (!source_.request.scale) {
        follow_direction(1, 0);
        follow_direction(-1, 0);
      }
      follow_direction(0, 1);
      follow_direction(0, -1);
      if (!source_.request.scale) {
        follow_direction(-1, -1);
        follow_direction(1, 1);
      }
      again = before != best_;
    }
    if (least_ >= kNothing) best_ = {source_.request.scale ? best_.scale : scales().size() - 1, 0};
    return best_;
  }

  void follow_direction(int scale_step, int coding_step) {
    const MeshKey from = best_;
    int worse = 0;
    for (int k = 1; worse < 2; ++k) {
      const int scale = static_cast<int>(from.scale) + k * scale_step, coding = from.coding + k * coding_step;
      if (scale < 0 || scale >= static_cast<int>(scales().size()) || coding < 0 || coding >= kMeshCodings)
        return;
      worse = better({static_cast<std::size_t>(scale), coding}) ? 0 : worse + 1;
    }
  }

  bool better(const MeshKey& key) {
    if (!seen_.insert(key).second) return key == best_;
    const double found = promising(key) ? look_closely(key) : kNothing;
    meshes_.forget(found < least_ ? best_ : key);
    if (!(found < least_)) return false;
    least_ = found;
    best_ = key;
    return true;
  }

  /// Its mesh alone is less different than the best file so far, and with that one's kind of textures it
  /// is hardly worse.
  bool promising(const MeshKey& key) {
    if (kLeastBytes * static_cast<double>(scales()[key.scale].triangles) >
        static_cast<double>(source_.request.bytes))
      return false;
    const MeshCandidate& mesh = meshes_.at(key);
    if (mesh.fixed_bytes > source_.request.bytes || mesh.geometry >= least_) return false;
    const auto known = points_.find(best_);
    if (source_.colours.empty() || known == points_.end() || known->second.difference >= kNothing)
      return true;
    const TexturePoint alike = colours_.same_size(mesh, colour_bytes(source_, mesh), known->second);
    return alike.difference < kWorthALook * least_;
  }

  double look_closely(const MeshKey& key) {
    seen_.insert(key);
    const MeshCandidate& mesh = meshes_.at(key);
    TexturePoint& point = points_[key];
    if (source_.colours.empty()) {
      point = {0, {colours_.format(), false}, 100, mesh.geometry};
      return mesh.fixed_bytes > source_.request.bytes ? kNothing : mesh.geometry;
    }
    const auto near = points_.find(best_);
    const bool known = near != points_.end() && near->second.difference < kNothing;
    const TexturePoint start = known ? near->second : TexturePoint{};
    point = colours_.best_size(mesh, colour_bytes(source_, mesh), known ? &start : nullptr);
    return point.difference;
  }

  /// The finest that is likely to leave half of the bytes to textures.
  std::size_t likely_scale() const {
    const double part = source_.textures.images().empty() ? 1.0 : 0.5;
    for (std::size_t k = 0; k < scales().size(); ++k)
      if (kUsualBytes * static_cast<double>(scales()[k].triangles) <=
          part * static_cast<double>(source_.request.bytes))
        return k;
    return scales().size() - 1;
  }

  Extracted finish(const MeshCandidate& mesh, const TexturePoint& point) {
    BudgetFile file = filler_.fill(mesh, point);
    Extracted out;
    out.scale = mesh.scale;
    out.levels = mesh.levels;
    out.triangles = mesh.triangles;
    out.within = filler_.fills(file);
    out.views = static_cast<int>(source_.cameras.size());
    out.side_px = source_.side_px;
    out.mesh_difference = mesh.geometry;
    out.images = file.rows;
    out.mesh_bytes = file.glb.size();
    for (const ExtractedImage& i : file.rows) out.mesh_bytes -= i.bytes;
    ImageTextures textures;
    for (const std::size_t i : source_.colours) {
      const std::uint32_t image = source_.image(i).image;
      textures[image_name(image)] = decoded_texture(file.images.at(image).bytes);
    }
    out.difference = source_.difference(*mesh.views, textures);
    out.glb = std::move(file.glb);
    return out;
  }

  BudgetSource source_;
  MeshCandidates meshes_;
  ColourTextures colours_;
  BudgetFiller filler_;
  std::map<MeshKey, TexturePoint> points_;
  std::set<MeshKey> seen_;
  MeshKey best_;
  double least_ = kNothing;
};

}  // namespace

std::vector<int> levels_of(const Manifest& manifest, int finest) {
  std::vector<int> out{finest};
  for (const ManifestScale& s : manifest.scales)
    if (s.major && s.scale > finest) out.push_back(s.scale);
  return out;
}

double screen_coverage_of(const Manifest& manifest, int scale) {
  constexpr double kScreenPx = 1080;
  double below = 0;  // displayed height up to which a coarser scale is enough
  for (const ManifestStep& s : manifest.steps)
    if (s.scale > scale) below = std::max(below, s.up_to_px);
  const double share = std::min(1.0, below / kScreenPx);
  return share * share;
}

Extracted extract_bytes(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  return BudgetSearch(package, request, context).run();
}

}  // namespace texmesh
