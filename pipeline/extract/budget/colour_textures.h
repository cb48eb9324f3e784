#pragma once
#include <cstdint>
#include <map>
#include <vector>

#include "pipeline/extract/budget/budget_source.h"
#include "pipeline/extract/budget/mesh_candidates.h"

namespace texmesh {

/// A way to code colours. JPEGs with full chroma nearly always look best; in very few bytes WebP may look
/// better. WebP's 8-bit YCbCr of limited range and halved chroma never comes nearer than FLIP 0.01 to 0.02 on
/// a photograph.
struct ColourCoding {
  FileImage format = FileImage::kWebp;
  bool full_chroma = false;
};

/// Textures of a size (a step, each 1 / sqrt 2 of the one before), at the quality that fills the bytes.
struct TexturePoint {
  int step = 0;
  ColourCoding coding;
  double quality = 0;
  double difference = 1e9;  // of the file; 1e9 = nothing fits
};

double size_step(int step);  // share of an image's sides

/// The textures of colours: how they are coded, and which size looks best in so many bytes.
class ColourTextures {
 public:
  /// Of the request only the format counts.
  ColourTextures(BudgetSource& source, const ExtractRequest& request);

  FileImage format() const { return format_; }  // of images that are not colours, and where nothing is chosen
  const std::vector<ColourCoding>& codings() const { return codings_; }
  /// The best size and quality for a mesh with `bytes` for all colours, in the first of codings(). Goes from
  /// `near`'s size, or from one that suits the bytes, towards both sides as long as the picture gets better.
  TexturePoint best_size(const MeshCandidate& mesh, double bytes, const TexturePoint* near);
  /// `near`, or textures of about the same size in another coding where these look better.
  TexturePoint best_of_other_codings(const MeshCandidate& mesh, double bytes, const TexturePoint& near);
  /// At the size and coding of `near` alone.
  TexturePoint same_size(const MeshCandidate& mesh, double bytes, const TexturePoint& near);

  /// Images `which` (indices into source.textures.images()) with sides of `share`. Texels that S_0 does not
  /// show continue the texels that S_0 shows. Such texels are cheap to code, and right for coarser meshes
  /// that overlap a seam a little.
  std::vector<Pixels> texels(const std::vector<std::size_t>& which, double share);
  std::vector<FileImageData> encoded(const std::vector<Pixels>& pixels, const ColourCoding& coding,
                                     double quality, bool quick) const;
  FileImage format_for(const Pixels& pixels, FileImage wanted) const;  // images with alpha are no JPEGs

 private:
  int likely_step(double bytes) const;
  float sharpening(double share) const;
  const std::vector<Pixels>& colours_at(int step);
  TexturePoint climb_sizes(const MeshCandidate& mesh, double bytes, int step, const ColourCoding& coding,
                           double limit);
  TexturePoint measure(const MeshCandidate& mesh, double bytes, int step, const ColourCoding& coding);
  BudgetSource& source_;
  FileImage format_ = FileImage::kWebp;
  double texels_per_pixel_ = 1;  // of the displayed surface, at full size
  std::map<int, std::vector<Pixels>> by_step_;
  std::vector<ColourCoding> codings_;   // those that compete
  std::map<int, double> last_quality_;  // by format and chroma: where the next search begins
};

}  // namespace texmesh
