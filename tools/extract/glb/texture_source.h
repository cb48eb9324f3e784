#pragma once

#include "format/model/model.h"
#include "stages/image/resize.h"
#include "stages/jpeg/source_jpeg.h"
#include "tools/extract/extract.h"

namespace texmesh {

/// Sharpening of colours that are made smaller (reduced()): it undoes the blur of averaging, and a little of
/// the blur of viewers.
inline constexpr float kSharpening = 0.06f;

/// A source image of a package: one image of every file that is extracted.
struct PackageImage {
  std::uint32_t image = 0;  // "texture/<image>"
  std::uint32_t plane = 0;  // full-size plane of its colours or data
  std::optional<std::uint32_t> alpha_plane;
  std::string role;
  std::uint32_t width_px = 0, height_px = 0;
  bool colours = true;  // sRGB encoded
  Averaging averaging() const;
};
std::vector<PackageImage> package_images(PackageReader& package);

/// Texels of a package's images at any size, from the best rungs. Images that were read stay in memory, at
/// the size that `most_texels` (over all colour images) allows.
class TextureSource {
 public:
  /// kBest cuts down colours alone. kUsual cuts numbers down, too, half as far, and reads the package's own
  /// planes of twice the sides; kFast as far, and reads planes of those sides, which show a little of their
  /// coding. `least_texels`: see leave_unread().
  TextureSource(PackageReader& package, double most_texels, const RunContext& context,
                ExtractEffort effort = ExtractEffort::kBest, double least_texels = 0);
  const std::vector<PackageImage>& images() const { return images_; }
  /// An image with these sides, of 1, 3 or, where the image has alpha, 4 channels. Sides are at least 1 and
  /// at most the image's; where memory is bounded, larger sides are cut down, see largest_share(). `coverage`
  /// (bits as TexturePlane::coverage, empty = all) holds the texels that a mesh shows; the other texels are
  /// made cheap to code. `sharpening` (see reduced()) is for colours alone.
  Pixels texels(std::size_t index, std::uint32_t width_px, std::uint32_t height_px,
                const std::vector<std::uint8_t>& coverage, float sharpening = kSharpening);
  /// Before texels are asked for: levels by image that are finer than what pictures read. Images are cut down
  /// by as many, as long as all of them have `least_texels` together. With kUsual alone.
  void leave_unread(std::vector<std::uint32_t> levels);
  /// Whether set_shown() matters: the image is read at full size.
  bool reads_whole(std::size_t index) const { return read_level(index) == 0; }
  /// Says which texels of an image at full size are shown, before any are asked for. Blocks of 8 x 8 without
  /// one, of which packages hold nothing true, are filled smoothly before smaller copies are made: those
  /// would take them in at the borders of charts.
  void set_shown(std::size_t index, std::vector<std::uint8_t> coverage);
  /// Largest share of an image's sides, 0 .. 1, that texels() gives.
  double largest_share(std::size_t index) const;
  /// Whether a source with these bounds gives the same texels.
  bool serves(double most_texels, double least_texels) const {
    return levels_cut(most_texels, least_texels) == cut_;
  }

 private:
  std::vector<std::uint32_t> levels_cut(double most_texels, double least_texels) const;
  std::uint32_t read_level(std::size_t index) const;
  std::vector<Pixels>& levels(std::size_t index, std::uint32_t plane, Averaging kind);
  const Pixels& level_for(std::size_t index, std::uint32_t plane, Averaging kind, std::uint32_t width_px,
                          std::uint32_t height_px);
  Pixels plane_texels(std::size_t index, std::uint32_t base, std::uint32_t width_px, std::uint32_t height_px,
                      const std::vector<std::uint8_t>& coverage, float sharpening);
  PackageReader& package_;
  RunContext context_;
  std::vector<PackageImage> images_;
  ExtractEffort effort_;
  double most_texels_, least_texels_;
  std::vector<std::uint32_t> unread_, cut_;                   // by image: how often sides are halved
  std::map<std::uint32_t, std::vector<std::uint8_t>> shown_;  // by plane
  std::map<std::uint32_t, std::vector<Pixels>> planes_;       // by plane: halves, as far as asked for
};

/// One rung of a plane of codec jpeg as one image. FormatError for another codec, and as JoinedJpeg.
JoinedJpeg joined_plane(PackageReader& package, std::uint32_t plane, std::size_t rung,
                        const RunContext& context);

/// Colours and alpha as one image of 4 channels; both of one size.
Pixels with_alpha(const Pixels& colours, const Pixels& alpha);

/// The planes of an image as one picture, as large as the smaller of the two.
Pixels with_alpha_of(const PackageImage& image, const Pixels& colours, const Pixels& alpha);

/// The texels of source image `image`, in a size of `width_px` x `height_px`, that a mesh shows with the
/// model's materials, as TexturePlane::coverage. The model's images are named as read_model() names them. All
/// texels of an image that no material shows by one of the first two sets of coordinates.
std::vector<std::uint8_t> shown_texels(const Mesh& mesh, const Model& model, std::uint32_t image,
                                       std::uint32_t width_px, std::uint32_t height_px);

/// An image as a file holds it.
struct FileImageData {
  FileImage format = FileImage::kJpeg;
  std::vector<std::uint8_t> bytes;
};

/// "image/jpeg", "image/webp", "image/avif", "image/png".
const char* mime_type_of(FileImage format);

/// The texels of a file of encode_image().
Pixels decode_file_image(const FileImageData& file);

/// How an image of a standalone file is coded.
struct ImageCoding {
  FileImage format = FileImage::kJpeg;
  double quality = 75;  // JPEG 1..100, WebP and AVIF 0..100; no meaning for PNG
  bool data = false;    // numbers (normals, roughness ..) instead of colours: JPEGs keep their channels apart
  bool quick = false;   // less time for some percent more bytes, for searches
  bool full_chroma = false;  // JPEG: colours 4:4:4, with tables for textures
};

/// A complete image file of 1, 3 or 4 channels (grey becomes RGB in a WebP; 4 channels are not for
/// JPEG). JPEG: progressive, with Huffman tables of its own, colours 4:2:0 or 4:4:4. WebP: lossy, with alpha
/// coded nearly without loss; AVIF likewise, 4:4:4. Same bytes for same input. StageError for what the format
/// cannot hold.
std::vector<std::uint8_t> encode_image(const Pixels& pixels, const ImageCoding& coding);

}  // namespace texmesh
