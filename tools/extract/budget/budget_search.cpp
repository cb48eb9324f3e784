#include "tools/extract/budget/budget_search.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "tools/extract/budget/budget_file.h"
#include "tools/extract/budget/budget_source.h"
#include "tools/extract/budget/file_looks.h"
#include "tools/extract/budget/mesh_candidates.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh {
namespace {

constexpr int kFirstCoding = 2;
constexpr double kNothing = 1e9;
constexpr double kFewestExtraBits = -3, kMostExtraBits = 9;
constexpr int kMeshTries = 12;
constexpr double kSurely = 0.9;  // of a loss that others tell
constexpr std::uint64_t kLookAtFilesBelow = 200000;
constexpr double kLikely = 1.2;  // times the least joined loss
constexpr std::size_t kMostLikely = 4;
constexpr double kUsualBytes = 3.5, kLeastBytes = 1.5;  // of a coded triangle

/// What searches for several numbers of bytes share.
struct SharedSearch {
  SharedSearch(PackageReader& package, const ExtractRequest& request, bool for_several,
               const RunContext& context)
      : source(package, request, context),
        meshes(source, for_several),
        coder(source),
        curves(source, coder),
        proxies(source) {}
  void set_bytes(std::uint64_t bytes) {
    if (source.request.bytes == bytes) return;
    source.request.bytes = bytes;
    meshes.forget_all();
  }
  BudgetSource source;
  MeshCandidates meshes;
  ImageCoder coder;
  LossCurves curves;
  ProxyOffers proxies;
};

/// Scale, coding of the mesh and textures, chosen together by what files look like.
class BudgetSearch {
 public:
  explicit BudgetSearch(SharedSearch& shared)
      : source_(shared.source),
        meshes_(shared.meshes),
        coder_(shared.coder),
        curves_(shared.curves),
        filler_(source_, coder_),
        looks_(source_, meshes_, coder_, filler_) {}

  /// `report`: parts of the way.
  Extracted run(const std::function<void(double)>& report) {
    curves_.measure(static_cast<double>(source_.request.bytes) -
                    kUsualBytes * static_cast<double>(scales()[start().scale].triangles));
    report(0.4);
    const MeshKey best = choose_mesh();
    report(0.6);
    FoundFile found = looks_.file_of(best, allocation_of(best));
    if (filler_.fits(found.file)) {
      if (source_.request.bytes <= kLookAtFilesBelow)
        look_at_files(found);
      else
        looks_.try_smaller_than_stored(found);
    }
    report(0.7);
    const bool fitting = filler_.fits(found.file) && !filler_.fills(found.file);
    if (fitting) fill_by_mesh(found);
    return finish(found.key, std::move(found.file));
  }

 private:
  const std::vector<ManifestScale>& scales() const { return source_.package.manifest().scales; }

  Allocation allocation_of(const MeshKey& key) { return curves_.allocate(bytes_left(meshes_.at(key))); }

  /// What meshes and textures lose is told from parts of pictures, one change at a time. Where files are
  /// small, which is nearest to the truth is seen in whole pictures: files of the likeliest meshes, and the
  /// texture that loses most in other sizes.
  void look_at_files(FoundFile& best) {
    looks_.look_at(best);
    for (const MeshKey& key : likeliest())
      looks_.replace_if_nearer(looks_.file_of(key, allocation_of(key)), best);
    looks_.try_other_files(curves_, best);
  }

  /// But for the best.
  std::vector<MeshKey> likeliest() const {
    std::vector<std::pair<double, MeshKey>> order;
    for (const auto& [key, loss] : predicted_)
      if (key != best_ && loss <= kLikely * least_) order.emplace_back(loss, key);
    std::ranges::sort(order);
    if (order.size() > kMostLikely) order.resize(kMostLikely);
    std::vector<MeshKey> out;
    for (const auto& [loss, key] : order) out.push_back(key);
    return out;
  }

  MeshKey start() {
    return {source_.request.scale ? source_.package.scale_index(*source_.request.scale) : likely_scale(),
            kFirstCoding};
  }

  /// From a likely mesh to its neighbours: finer, coarser, coded finer and leaner, and a finer one
  /// coded leaner or the other way round, as long as the picture gets better; one that does not is
  /// passed over once.
  MeshKey choose_mesh() {
    best_ = start();
    least_ = loss_of(best_);
    for (bool again = true; again;) {
      const MeshKey before = best_;
      if (!source_.request.scale) {
        follow_direction(-1, 0);
        follow_direction(1, 0);
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
    const double found = too_large(key) || least_loss(key) > least_ ? kNothing : loss_of(key);
    meshes_.forget(found < least_ ? best_ : key);
    if (!(found < least_)) return false;
    least_ = found;
    best_ = key;
    return true;
  }

  bool too_large(const MeshKey& key) const {
    return kLeastBytes * static_cast<double>(scales()[key.scale].triangles) >
           static_cast<double>(source_.request.bytes);
  }

  /// What the mesh is expected to lose at least: scale and coding of a mesh lose apart, and finer ones of
  /// both kinds lose less.
  double least_loss(const MeshKey& key) const {
    double least = 0;
    for (const auto& [known, geometry] : geometry_) {
      if (known.scale > key.scale) continue;
      double loss = joined(geometry);
      if (known.coding < key.coding) {
        const auto coded = geometry_.find({0, known.coding});
        if (known.scale == 0 || coded == geometry_.end()) continue;
        loss -= joined(coded->second);
      }
      least = std::max(least, kSurely * loss);
    }
    return least;
  }

  double bytes_left(const MeshCandidate& mesh) const {
    return static_cast<double>(source_.request.bytes) - static_cast<double>(mesh.fixed_bytes);
  }

  /// What a file of this mesh is expected to lose.
  double loss_of(const MeshKey& key) {
    seen_.insert(key);
    const MeshCandidate& mesh = meshes_.at(key);
    geometry_[key] = mesh.geometry;
    const Allocation images = curves_.allocate(bytes_left(mesh));
    if (images.bytes > bytes_left(mesh)) return kNothing;
    return predicted_[key] = joined(mesh.geometry) + images.loss;
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

  /// `from` with its mesh coded finer by parts of a bit: the largest file that was found. Nothing
  /// where all that fit are smaller.
  std::optional<FoundFile> larger_by_bits(const FoundFile& from, std::size_t scale, int coding) {
    const bool same = scale == from.key.scale && coding == from.key.coding;
    double low = same ? 0 : kFewestExtraBits, high = kMostExtraBits;
    std::optional<FoundFile> best;
    for (int i = 0; i < kMeshTries && !(best && filler_.fills(best->file)); ++i) {
      FoundFile other = from;
      other.key = {scale, coding, (low + high) / 2};
      other.file.glb = meshes_.at(other.key).file_with(from.file.images);
      meshes_.forget(other.key);
      (filler_.fits(other.file) ? low : high) = other.key.extra_bits;
      if (filler_.fits(other.file) && other.file.glb.size() >= (best ? *best : from).file.glb.size())
        best = std::move(other);
    }
    return best;
  }

  /// Where textures cannot take the bytes that are left: the same mesh coded finer, or a finer scale. Of
  /// several codings the one that looks nearest.
  void fill_by_mesh(FoundFile& best) {
    if (is_finest(best.key) || !meshes_.at(best.key).file->has_draco()) return;
    const FoundFile from = best;
    looks_.look_at(best);
    for (std::size_t scale = from.key.scale;; --scale) {
      for (int coding = from.key.coding; coding < kMeshCodings; ++coding) {
        std::optional<FoundFile> other = larger_by_bits(from, scale, coding);
        if (!other || filler_.fills(other->file) < filler_.fills(best.file)) continue;
        looks_.look_at(*other);
        if (filler_.fills(other->file) > filler_.fills(best.file) || other->difference <= best.difference)
          best = *std::move(other);
      }
      if (scale == 0 || filler_.fills(best.file) || source_.request.scale) return;
    }
  }

  /// S_0 as it is stored.
  static bool is_finest(const MeshKey& key) { return key.scale == 0 && key.coding + 1 == kMeshCodings; }

  Extracted finish(const MeshKey& key, BudgetFile file) {
    const MeshCandidate& mesh = meshes_.at(key);
    Extracted out;
    out.scale = mesh.scale;
    out.levels = mesh.levels;
    out.triangles = mesh.triangles;
    out.within = filler_.fills(file) || (filler_.fits(file) && file.has_sources && is_finest(key));
    out.views = static_cast<int>(source_.cameras.size());
    out.side_px = source_.side_px;
    out.images = file.rows;
    out.mesh_bytes = file.glb.size();
    for (const ExtractedImage& i : file.rows) out.mesh_bytes -= i.bytes;
    const std::vector<double> differences = looks_.differences_of(key, file);
    out.mesh_difference = differences[0];
    out.difference = differences[1];
    out.glb = std::move(file.glb);
    return out;
  }

  BudgetSource& source_;
  MeshCandidates& meshes_;
  ImageCoder& coder_;
  LossCurves& curves_;
  BudgetFiller filler_;
  FileLooks looks_;
  std::set<MeshKey> seen_;
  std::map<MeshKey, double> geometry_;   // of meshes looked at: MeshCandidate::geometry
  std::map<MeshKey, double> predicted_;  // joined losses of files, of meshes whose files fit
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

std::vector<Extracted> extract_bytes(PackageReader& package, const ExtractRequest& request,
                                     const std::vector<std::uint64_t>& bytes, const RunContext& context) {
  std::vector<std::size_t> order(bytes.size());  // rising: neighbours share most
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return bytes[k]; });
  std::vector<Extracted> out(bytes.size());
  std::unique_ptr<SharedSearch> shared;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::uint64_t wanted = bytes[order[i]];
    const auto report = [&](double part) {
      context.report((static_cast<double>(i) + part) / static_cast<double>(order.size()));
    };
    if (!shared || !shared->source.serves(wanted)) {
      ExtractRequest one = request;
      one.bytes = wanted;
      shared.reset();  // before the next one needs the memory
      shared = std::make_unique<SharedSearch>(package, one, bytes.size() > 1, context);
    }
    shared->set_bytes(wanted);
    report(0.2);
    Extracted& found = out[order[i]];
    found = BudgetSearch(*shared).run(report);
    report(0.9);
    shared->proxies.offer(found);
    report(1);
  }
  return out;
}

}  // namespace texmesh
