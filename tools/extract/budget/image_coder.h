#pragma once
#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "stages/jpeg/source_jpeg.h"
#include "tools/extract/budget/budget_source.h"

namespace texmesh {

/// A way to code an image. JPEGs with full chroma nearly always look best; in very few bytes WebP may look
/// better. WebP's 8-bit YCbCr of limited range and halved chroma never comes nearer than FLIP 0.01 to 0.02 on
/// a photograph.
struct TextureCoding {
  FileImage format = FileImage::kWebp;
  bool full_chroma = false;
  /// The package's own coefficients of the source, at full size: quality 100 is the source's own, of which
  /// less quality keeps less. What was never decoded loses nothing.
  bool stored = false;
  friend auto operator<=>(const TextureCoding&, const TextureCoding&) = default;
};

/// What becomes of an image.
struct ImagePlan {
  TextureCoding coding;
  double share = 1;  // of the image's sides
  double quality = 0;
  /// Nothing of the package comes nearer to the source.
  bool is_source() const { return coding.stored && quality >= 100; }
  friend bool operator==(const ImagePlan&, const ImagePlan&) = default;
};

double size_step(int step);  // share of an image's sides, each 1 / sqrt 2 of the one before
inline constexpr int kSizeSteps = 30;

/// Texels of a package's images at any size, and files of them.
class ImageCoder {
 public:
  explicit ImageCoder(BudgetSource& source);

  /// The codings that compete for an image, the usual one first.
  std::vector<TextureCoding> codings(std::size_t image) const;
  /// Bytes that the package has of the source's own coefficients; nothing where it has none, or where they
  /// are not wanted.
  std::optional<double> stored_bytes(std::size_t image) const;
  /// Before encoded() with stored coefficients: reads them, once.
  void load_stored(std::size_t image);
  /// An image at a share of its sides. Texels that S_0 does not show continue the texels that S_0 shows. Such
  /// texels are cheap to code, and right for coarser meshes that overlap a seam a little. Images of a size
  /// step stay in memory.
  const Pixels& texels(std::size_t image, int step);
  Pixels texels_of_share(std::size_t image, double share);
  /// `quick`: for comparisons (see ImageCoding). Of stored coefficients `pixels` may be empty.
  FileImageData encoded(std::size_t image, const Pixels& pixels, const TextureCoding& coding, double quality,
                        bool quick) const;
  /// The textures of what a file shows, by their places in BudgetSource::shown.
  OtherTextures shown_by(std::size_t image, const FileImageData& file, const RunContext& context) const;

 private:
  float sharpening(std::size_t image, double share) const;
  BudgetSource& source_;
  std::map<std::pair<std::size_t, int>, Pixels> by_step_;
  std::map<std::size_t, JoinedJpeg> stored_;
};

}  // namespace texmesh
