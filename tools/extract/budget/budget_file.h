#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "tools/extract/budget/loss_curves.h"
#include "tools/extract/budget/mesh_candidates.h"

namespace texmesh {

/// A file of a search, with a row of the report for each of its images.
struct BudgetFile {
  std::map<std::uint32_t, FileImageData> images;  // by source image
  std::vector<ExtractedImage> rows;               // by image
  std::vector<std::uint8_t> glb;
  bool has_sources = false;  // all images are the source's, as the package holds them
};

/// Fills the bytes asked for: the largest file within them by quality, then by size of the textures.
class BudgetFiller {
 public:
  BudgetFiller(const BudgetSource& source, ImageCoder& coder) : source_(source), coder_(coder) {}
  /// Where nothing fits: the smallest file.
  BudgetFile fill(const MeshCandidate& mesh, const Allocation& allocation);
  bool fits(const BudgetFile& file) const { return file.glb.size() <= source_.request.bytes; }
  bool fills(const BudgetFile& file) const;  // to 98 %

 private:
  /// Images while a file is looked for.
  struct Draft {
    std::vector<ImagePlan> plans;
    std::vector<Pixels> pixels;
    std::vector<FileImageData> files;
  };
  Draft draft_of(const std::vector<ImagePlan>& plans);
  void encode(Draft& draft, const std::vector<std::size_t>& images) const;
  void resize(Draft& draft, const std::vector<ImagePlan>& plans, double times);
  void set_pixels(Draft& draft, std::size_t image);
  void by_source(const MeshCandidate& mesh, const Allocation& allocation, Draft& draft, BudgetFile& best);
  BudgetFile file_of(const MeshCandidate& mesh, const Draft& draft) const;
  /// Makes the file that fills best of those with level 1 .. 100 of `at`, which grow with it.
  void by_level(double start, int tries, const std::function<BudgetFile(double level)>& at, BudgetFile& best);
  void by_last_image(const MeshCandidate& mesh, std::size_t last, Draft& draft, BudgetFile& best);
  void by_all_qualities(const MeshCandidate& mesh, Draft& draft, BudgetFile& best);
  void by_sizes(const MeshCandidate& mesh, Draft& draft, BudgetFile& best);
  void by_codings(const MeshCandidate& mesh, Draft& draft, BudgetFile& best);
  void replace_if_larger(BudgetFile&& file, BudgetFile& best) const;
  BudgetFile smallest(const MeshCandidate& mesh);
  const BudgetSource& source_;
  ImageCoder& coder_;
};

}  // namespace texmesh
