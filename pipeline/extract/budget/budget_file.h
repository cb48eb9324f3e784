#pragma once
#include <cstdint>
#include <map>
#include <vector>

#include "pipeline/extract/budget/colour_textures.h"

namespace texmesh {

/// A file of a search, with a row of the report for each of its images.
struct BudgetFile {
  std::map<std::uint32_t, FileImageData> images;  // by source image
  std::vector<ExtractedImage> rows;               // by image
  std::vector<std::uint8_t> glb;
};

/// Bytes of a file that are left for textures of colours, once those of data (normals, roughness), which the
/// pictures do not show, have a fixed share.
double colour_bytes(const BudgetSource& source, const MeshCandidate& mesh);

/// Fills the bytes asked for: the largest file within them by quality, then by size of the textures.
class BudgetFiller {
 public:
  BudgetFiller(const BudgetSource& source, ColourTextures& colours) : source_(source), colours_(colours) {}
  /// Where nothing fits: the smallest file.
  BudgetFile fill(const MeshCandidate& mesh, const TexturePoint& point);
  bool fits(const BudgetFile& file) const { return file.glb.size() <= source_.request.bytes; }
  bool fills(const BudgetFile& file) const;  // to 98 %

 private:
  void add(BudgetFile& file, std::size_t index, const Pixels& pixels, FileImageData data,
           double quality) const;
  void add_data(double bytes, BudgetFile& file);
  BudgetFile with_colours(const MeshCandidate& mesh, const BudgetFile& data,
                          const std::vector<Pixels>& pixels, const ColourCoding& coding,
                          double quality) const;
  void by_quality(const MeshCandidate& mesh, const BudgetFile& data, const std::vector<Pixels>& pixels,
                  const ColourCoding& coding, double start, int tries, BudgetFile& best, double& quality);
  void by_size(const MeshCandidate& mesh, const BudgetFile& data, const ColourCoding& coding, double quality,
               double& share, BudgetFile& best);
  void replace_if_larger(BudgetFile&& file, BudgetFile& best) const;
  const BudgetSource& source_;
  ColourTextures& colours_;
};

}  // namespace texmesh
