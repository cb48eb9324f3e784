#pragma once
#include <vector>

#include "pipeline/extract/budget/budget_file.h"

namespace texmesh {

/// A file of a mesh with textures as `images` plan them, and its difference in whole pictures, where it has
/// been looked at.
struct FoundFile {
  MeshKey key;
  Allocation images;
  BudgetFile file;
  double difference = 1e9;
};

/// Files as whole pictures show them. For .cpp files of this folder.
class FileLooks {
 public:
  FileLooks(BudgetSource& source, MeshCandidates& meshes, ImageCoder& coder, BudgetFiller& filler)
      : source_(source), meshes_(meshes), coder_(coder), filler_(filler) {}

  /// The file that fills the bytes. It is not looked at.
  FoundFile file_of(const MeshKey& key, const Allocation& images);
  void look_at(FoundFile& found) { found.difference = differences_of(found.key, found.file).back(); }
  /// Looks at `found` where it fills the bytes. Whether it has become the best.
  bool replace_if_nearer(FoundFile found, FoundFile& best);
  /// The texture that loses most larger and coarser, then smaller and finer, as long as that is nearer.
  void try_other_sizes(FoundFile& best);
  /// Of the mesh alone, and of the file.
  std::vector<double> differences_of(const MeshKey& key, const BudgetFile& file);

 private:
  BudgetSource& source_;
  MeshCandidates& meshes_;
  ImageCoder& coder_;
  BudgetFiller& filler_;
};

}  // namespace texmesh
