#pragma once
#include <vector>

#include "tools/extract/budget/budget_file.h"

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
  /// The texture that loses most in other sizes and codings, with more or fewer bytes for others, and with
  /// the mesh coded finer or leaner, as long as that is nearer.
  void try_other_files(const LossCurves& curves, FoundFile& best);
  /// Where the texture that loses most is to be some of the source's own coefficients: smaller and finer.
  void try_smaller_than_stored(FoundFile& best);
  /// Of the mesh alone, and of the file.
  std::vector<double> differences_of(const MeshKey& key, const BudgetFile& file);

 private:
  /// What decides about a file, but for the quality of the texture that takes the bytes that are left.
  struct Way {
    MeshKey key;
    std::size_t last = 0;
    std::vector<ImagePlan> plans;
    friend bool operator==(const Way&, const Way&) = default;
  };
  // Whether the best has changed.
  bool try_file(const MeshKey& key, const Allocation& images, FoundFile& best);
  bool try_other_sizes(FoundFile& best);
  bool try_other_codings(FoundFile& best);
  bool try_other_codings_of_mesh(FoundFile& best);
  bool try_other_shares(const LossCurves& curves, FoundFile& best);
  BudgetSource& source_;
  MeshCandidates& meshes_;
  ImageCoder& coder_;
  BudgetFiller& filler_;
  std::vector<Way> ways_;  // gone already
};

}  // namespace texmesh
