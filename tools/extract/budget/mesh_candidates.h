#pragma once
#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "tools/extract/budget/budget_source.h"

namespace texmesh {

/// How many ways to code a mesh there are, from the leanest to the finest (of S_0: as it is stored).
inline constexpr int kMeshCodings = 6;

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
  std::uint64_t fixed_bytes = 0;  // the file without its images' bytes
  double geometry = 0;            // difference with the best textures, in the windows

  /// The file with these images. An image that is not given has no bytes.
  std::vector<std::uint8_t> file_with(const std::map<std::uint32_t, FileImageData>& images) const;
};

/// Makes candidates when they are first asked for, and keeps them until forget().
class MeshCandidates {
 public:
  /// `for_several`: coded meshes are kept for searches for other numbers of bytes.
  explicit MeshCandidates(const BudgetSource& source, bool for_several = false)
      : source_(source), for_several_(for_several) {}
  const MeshCandidate& at(const MeshKey& key);
  /// The mesh as viewers show it.
  const LitMesh& mesh(const MeshKey& key);
  void forget(const MeshKey& key);  // a mesh takes tens of megabytes
  /// Before a search for another number of bytes: BudgetSource::request has changed.
  void forget_all();

 private:
  /// What does not depend on the number of bytes.
  struct Shape {
    std::shared_ptr<const StandaloneGlb> file;  // without what is known of the object
    std::unique_ptr<LitMesh> mesh;              // or null: to be made again
    double geometry = 0;
  };
  DracoSteps steps_of(const MeshKey& key) const;
  int scale_of(const MeshKey& key) const;
  std::vector<int> levels(const MeshKey& key) const;
  std::unique_ptr<StandaloneGlb> recoded_scale(int scale, const MeshKey& key) const;
  std::unique_ptr<LitMesh> lit_mesh(const StandaloneGlb& file, const MeshKey& key) const;
  const Shape& shape(const MeshKey& key);
  const BudgetSource& source_;
  bool for_several_;
  std::map<MeshKey, MeshCandidate> made_;
  std::map<MeshKey, Shape> shapes_;
};

}  // namespace texmesh
