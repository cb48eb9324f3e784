#pragma once
// Inside the room only: what a report shows in colours.

#include "stages/measure/flip.h"
#include "tools/extract/package_model.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh {

/// The colour of a value 0..1 (clipped) on a scale from black over purple and orange to pale yellow, whose
/// lightness rises evenly: it reads in grey, too. sRGB, 0..255.
Srgb heat_colour(double value);

/// Such a colour for HTML: "#rrggbb".
std::string heat_hex(double value);

/// A file that stands beside the page.
struct ReportFile {
  std::string path;
  Bytes bytes;
};

/// FLIP that has the last colour of maps.
inline constexpr double kFullHeat = 0.4;

/// Two pictures and their FLIP map side by side, cut to what they show, as PNG files.
struct PictureRow {
  std::string name;                         // of the files: letters, digits and '-'
  std::string reference_name, tested_name;  // HTML, above the pictures
  std::string alt;                          // plain text: what is seen
  double enlarge_to_px = 220;               // small pictures are shown this wide, in whole multiples
};
/// HTML; the files are appended.
std::string picture_row(const PictureRow& row, const Picture& reference, const Picture& tested,
                        std::vector<ReportFile>& files);

/// What stands on the fragments of a plane: 0..1, -1 = not stored.
struct FragmentHeat {
  std::string name;           // plain text: what the colours mean
  std::vector<double> value;  // per fragment; empty = the grid alone
};
/// Bytes per covered texel at the best rung, and feature density eta of S_0; each over its largest value.
std::vector<FragmentHeat> fragment_heats(PackageReader& package, std::uint32_t plane);

/// The plane's preview, a file of that name beside the page, beneath the grid of fragments in heat colours.
/// HTML; `plane` is a full-size one.
std::string fragment_map(PackageReader& package, std::uint32_t plane, const FragmentHeat& heat,
                         const std::string& preview);

/// One of `count` directions that are spread evenly over the sphere.
struct ViewNumber {
  int index = 0, count = 1;
};

/// Lit pictures of a package's scales, all with the same textures and by the same cameras: S_0's bounding
/// sphere fills 0.96 of the side. Textures of the package are read with mips, as the quality stage reads
/// them, whatever the samplers say. The displayed height is the length on screen of the object's largest
/// extent at the sphere's centre. Same pictures for any thread count.
class PackagePictures {
 public:
  /// `package` must outlive this object.
  PackagePictures(PackageReader& package, const PackageChoice& textures, const RunContext& context);
  /// Side of a picture in which the object is displayed so high; 1..8192.
  std::uint32_t side_for(double displayed_px) const;
  /// The largest displayed height of which there are pictures.
  double largest_px() const;
  Picture picture(int scale, ViewNumber view, std::uint32_t side_px);
  /// A model in the frame that `offset` leads to from the package's, by the same camera.
  Picture picture_of(const RenderedModel& model, Vec3d offset, ViewNumber view, std::uint32_t side_px) const;
  const RenderedModel& finest() const { return finest_; }
  const RunContext& context() const { return context_; }

 private:
  RenderCamera camera(Vec3d offset, ViewNumber view) const;
  PackageReader& package_;
  RunContext context_;
  RenderedModel finest_;
  RenderEnvironment environment_;
  int coarser_number_ = 0;  // 0: none yet
  RenderedModel coarser_;   // the last one that was asked for
};

/// How one picture differs from another in the views of one displayed height.
struct ViewDifferences {
  std::vector<float> mean, p95;  // FLIP of each view, over the pixels that either picture covers
  std::size_t worst() const;     // the view of the largest mean
  double worst_mean() const, worst_p95() const;  // of all views; 0 without views
};

/// How far pictures may differ before a scale can be told from S_0. Values of texmesh's own.
struct FlipLimits {
  double mean = 0.05;  // FLIP of a view, over the pixels that either picture covers
  double p95 = 0.15;   // 95th percentile of these pixels
};

/// A step of the package's step function, rendered at the height up to which it serves.
struct SwitchSize {
  int scale = 0;
  std::uint32_t triangles = 0;
  double up_to_px = 0;     // as the manifest has it
  double rendered_px = 0;  // less than up_to_px where pictures would be too large
  ViewDifferences views;
  bool holds(const FlipLimits& limits) const {
    return views.worst_mean() <= limits.mean && views.worst_p95() <= limits.p95;
  }
};

/// Every step but S_0's, coarse to fine, in `views` directions spread evenly over the sphere.
std::vector<SwitchSize> measure_switch_sizes(PackageReader& package, PackagePictures& pictures, int views,
                                             const RunContext& context);

/// One sentence that says whether all hold, and which do not.
std::string switch_verdict(const std::vector<SwitchSize>& sizes, const FlipLimits& limits, int views);

/// The largest FLIP, mean of a view, of all of them; 0 for none.
double worst_flip(const std::vector<SwitchSize>& sizes);

}  // namespace texmesh
