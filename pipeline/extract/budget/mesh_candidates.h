#pragma once
#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "pipeline/extract/budget/budget_source.h"

namespace texmesh {

/// How many ways to code a mesh there are, from the leanest to the finest (of S_0: as it is stored).
inline constexpr int kMeshCodings = 5;

/// A scale, as an index into the manifest's scales, and how finely it is coded, 0 .. kMeshCodings - 1; with
/// `extra_bits` (any part of one) for its positions and texture coordinates, where bytes have to be filled.
struct MeshKey {
  std::size_t scale = 0;
  int coding = 0;
  double extra_bits = 0;
  friend auto operator<=>(const MeshKey&, const MeshKey&) = default;
};

/// A scale (with its coarser levels, where they are asked for) that could be the mesh of the file.
struct MeshCandidate {
  int scale = 0;
  std::vector<int> levels;
  std::uint64_t triangles = 0;
  std::shared_ptr<const StandaloneGlb> file;
  LitMesh mesh;
  std::unique_ptr<LitViews> windows;
  std::uint64_t fixed_bytes = 0;  // the file without its images' bytes
  double geometry = 0;            // difference with the best textures, in the windows

  /// The file with these images. An image that is not given has no bytes.
  std::vector<std::uint8_t> file_with(const std::map<std::uint32_t, FileImageData>& images) const;
};

/// Makes candidates when they are first asked for, and keeps them until forget().
class MeshCandidates {
 public:
  explicit MeshCandidates(const BudgetSource& source) : source_(source) {}
  const MeshCandidate& at(const MeshKey& key);
  void forget(const MeshKey& key) { made_.erase(key); }  // a candidate's pictures take tens of megabytes

 private:
  DracoSteps steps_of(const MeshKey& key) const;
  std::unique_ptr<StandaloneGlb> recoded_scale(int scale, const MeshKey& key) const;
  const BudgetSource& source_;
  std::map<MeshKey, MeshCandidate> made_;
};

}  // namespace texmesh
