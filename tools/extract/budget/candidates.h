#pragma once
#include <compare>
#include <list>
#include <ranges>

#include "stages/gltf/scale_fineness.h"
#include "tools/extract/budget/texture_tiles.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {

/// Scales of a file with levels of detail whose finest is `finest`: that one, and all coarser ones of the
/// step function; where that has none, the coarsest scale, which some viewers show while the others load.
std::vector<int> levels_of(const Manifest& manifest, int finest);
/// What MSFT_lod asks for a level: viewers show it above this share of the screen's area. A square around the
/// object has it at the displayed height up to which the next of `levels` is enough, on a screen 1080 px
/// high. 0 of the last level.
double screen_coverage_of(const Manifest& manifest, const std::vector<int>& levels, std::size_t level);

/// How many ways to code a mesh there are, from the leanest to the finest (of S_0: as it is stored).
inline constexpr int kMeshCodings = static_cast<int>(kScaleFineness.size());

/// A scale, as an index into the manifest's scales, and how finely it is coded, 0 .. kMeshCodings - 1; with
/// `extra_bits` (any part of one) for its positions and texture coordinates, where bytes have to be filled.
struct MeshKey {
  std::size_t scale = 0;
  int coding = 0;
  double extra_bits = 0;
  /// S_0 as it is stored.
  bool is_finest() const { return scale == 0 && coding + 1 == kMeshCodings && extra_bits >= 0; }
  friend auto operator<=>(const MeshKey&, const MeshKey&) = default;
};

/// A scale (with its coarser levels, where they are asked for) that could be the mesh of the file.
struct MeshCandidate {
  int scale = 0;
  std::vector<int> levels;
  std::uint64_t triangles = 0;
  double geometry = 0;                        // difference with the best textures, in the windows
  std::shared_ptr<const StandaloneGlb> file;  // without what is known of the object
  std::unique_ptr<const LitMesh>
      lit;  // as viewers show it; null: Candidates::lit_mesh() makes it again, or has it
  std::vector<std::unique_ptr<const LitViews>> views;  // of `lit`, each of a camera that was asked for
};

/// Losses in the same pixels, of a mesh and of the images of a material, join about as the sum of their
/// squares. (Predicted so, what was rendered was 0.94 to 0.98 of it on five scans.) Losses in other pixels
/// just add up.
inline double joined(double loss) { return loss * loss; }

inline constexpr double kLowestQuality = 1, kHighestQuality = 100;

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

/// A file of one image to be looked at.
struct ImageTrial {
  std::size_t image = 0;
  int step = 0;  // of size_step()
  TextureCoding coding;
  double quality = 0;
  friend auto operator<=>(const ImageTrial&, const ImageTrial&) = default;
};

/// A file of one image, and what it costs in the pictures.
struct CodedImage {
  ImagePlan plan;
  double bytes = 0;
  double loss = 0;  // joined(FLIP) with everything else at its best
};

/// What files can be made of: coded meshes, and images at any size in any coding. Each is made when it is
/// first asked for, and kept for searches for other numbers of bytes; what was asked for before changes
/// nothing but the time.
class Candidates {
 public:
  /// `for_several`: forget() keeps coded meshes, for searches for other numbers of bytes.
  Candidates(const Reference& reference, TextureSource& textures, bool for_several = false)
      : reference_(reference), textures_(textures), for_several_(for_several) {}

  const MeshCandidate& mesh(const MeshKey& key);
  /// What a camera sees of the mesh, as one of some views, after prepare_views(). Several threads may ask for
  /// different cameras.
  std::pair<const LitViews&, std::size_t> view(const MeshKey& key, std::size_t camera,
                                               const RunContext& context);
  void prepare_views(const MeshKey& key);
  void forget(const MeshKey& key);  // a mesh takes tens of megabytes
  void forget_lit_meshes();

  /// The largest size that there are texels of.
  int first_step(std::size_t image) const;
  /// The codings that compete for an image, the usual one first.
  std::vector<TextureCoding> codings(std::size_t image) const;
  /// Bytes that the package has of the source's own coefficients; nothing where it has none, or where they
  /// are not wanted.
  std::optional<double> stored_bytes(std::size_t image) const;
  /// Before encoded() with stored coefficients: reads them, once.
  void load_stored(std::size_t image);
  /// An image at a share of its sides. Texels that S_0 does not show continue the texels that S_0 shows. Such
  /// texels are cheap to code, and right for coarser meshes that overlap a seam a little.
  Pixels texels(std::size_t image, double share);
  /// `quick`: for comparisons (see ImageCoding). Of stored coefficients `pixels` may be empty.
  FileImageData encoded(std::size_t image, const Pixels& pixels, const TextureCoding& coding, double quality,
                        bool quick) const;
  /// The textures of what a file shows, by their places in Reference::shown.
  OtherTextures shown_by(std::size_t image, const FileImageData& file, const RunContext& context) const;
  /// Files of single images, in turn: S_0 is rendered in the windows with one image changed at a time.
  std::vector<CodedImage> measured(const std::vector<ImageTrial>& trials);

 private:
  DracoSteps steps_of(const MeshKey& key) const;
  /// A scale as the package has it, on its way into codings.
  struct ScaleToCode {
    int scale = 0;
    StandaloneGlb file;
    DracoRecoder recoder;
  };
  ScaleToCode& scale_to_code(int scale);
  std::unique_ptr<StandaloneGlb> recoded_scale(int scale, const MeshKey& key);
  const LitMesh& lit_mesh(const MeshKey& key);
  std::unique_ptr<const LitMesh> made_lit_mesh(const StandaloneGlb& file, int scale) const;
  float sharpening(std::size_t image, double share) const;
  Vec2<std::uint32_t> sides(std::size_t image, double share) const;
  const Pixels& texels_of_step(std::size_t image, int step);
  const TextureTiles* tiles_for(const ImageTrial& trial);
  OtherTextures trial_textures(const ImageTrial& trial, const TextureTiles* tiles, const RunContext& context,
                               double& bytes);
  void measure_together(std::span<const ImageTrial> trials);
  const Reference& reference_;
  TextureSource& textures_;
  bool for_several_;
  std::list<ScaleToCode> scales_;  // the last first
  std::map<MeshKey, MeshCandidate> meshes_;
  std::map<std::pair<std::size_t, int>, Pixels> by_step_;
  std::map<std::pair<std::size_t, double>, Pixels> small_;  // by image and share of its sides
  struct StepTiles {
    Pixels image;
    std::optional<TextureTiles> tiles;
  };
  std::map<std::pair<std::size_t, int>, StepTiles> tiles_;
  std::map<std::size_t, std::vector<Vec2f>> places_read_;  // by image
  std::map<std::size_t, JoinedJpeg> stored_;
  std::map<ImageTrial, CodedImage> measured_;
};

/// What becomes of all images in so many bytes.
struct DealtBytes {
  std::vector<CodedImage> images;  // by image; bytes and loss of the one between two files are between theirs
  double bytes = 0;
  double loss = 0;       // joined(FLIP) of all images together
  std::size_t last = 0;  // the image that got the last bytes
};

/// For each image the files that give most for their bytes, found by rendering S_0 with one image changed at
/// a time. Constant once made.
class LossCurves {
 public:
  /// Looks at files around what each image may get of `bytes` for all of them. With ExtractEffort::kFast it
  /// reads the package's tables instead.
  LossCurves(const Reference& reference, Candidates& candidates, double bytes);
  /// The least loss of at most `bytes`; the smallest files where nothing fits.
  DealtBytes allocate(double bytes) const;
  /// Another file of an image on its curve, that with next more bytes than `from`, or next fewer with a step
  /// of -1; null where there is none.
  const CodedImage* neighbour(std::size_t image, const CodedImage& from, int step) const;

 private:
  class Trials;
  void read_tables();
  void add_sources(double most_bytes);
  void look_at(const std::vector<ImageTrial>& trials);
  void find_curves();
  double likely_bytes(std::size_t image, double bytes) const;
  std::vector<ImageTrial> first_trials(double bytes) const;
  std::vector<ImageTrial> trials_around_first(double bytes) const;
  std::vector<ImageTrial> trials_around(const DealtBytes& chosen, double bytes) const;
  DealtBytes allocate(double bytes, const std::vector<double>& group_weights) const;
  std::vector<double> group_losses(const DealtBytes& allocation) const;
  const Reference& reference_;
  Candidates& candidates_;
  std::vector<std::vector<CodedImage>> seen_, curves_;  // by image; curves by rising bytes, convex
};

}  // namespace texmesh
