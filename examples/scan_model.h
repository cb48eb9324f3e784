#pragma once

#include <memory>

#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// A made scan: an object with the habits of photogrammetry (irregular triangles, measuring noise,
/// holes, an atlas of many charts with black gutters, exposure that jumps at seams). The same bytes on every
/// machine and for any number of threads.
enum class ScanForm { kRock, kOwl };

struct ScanOptions {
  ScanForm form = ScanForm::kRock;
  int triangles = 100'000;  // about
  int texture_px = 2048;    // side of the square textures; 0 = no texture, vertex colours instead
  int charts = 60;
  int holes = 2;
  double noise = 0.0002;  // measuring noise across the surface, fraction of the diagonal
  int seed = 1;
  bool all_textures = false;  // normal and occlusion-roughness-metallic maps beside the base colour
  int enlarge = 1;            // textures are painted at this part of their size
  int jpeg_quality = 92;
  int range_columns = 720, range_rows = 480;  // samples of the range-scan form
};

/// What a point of the made surface looks like.
struct ShapeSample {
  Vec3d colour;       // sRGB, 0..1
  double height = 0;  // relief too fine for the mesh, object units
  double occlusion = 1, roughness = 0.8;
};

/// The made object: its form and its look. Pure functions of the seed.
class ScanShape {
 public:
  virtual ~ScanShape() = default;
  /// Surface point in a unit direction from the middle; the object stands about 0.3 units high around the
  /// origin, its up side at +y.
  virtual Vec3d point(Vec3d direction) const = 0;
  /// `finest` is the size of the smallest detail to paint, object units: that of a texel.
  virtual ShapeSample sample(Vec3d position, Vec3d normal, double finest) const = 0;
};

/// A lump of weathered stone, clay, bronze or wood.
class RockShape final : public ScanShape {
 public:
  explicit RockShape(std::uint32_t seed);
  Vec3d point(Vec3d direction) const override;
  ShapeSample sample(Vec3d position, Vec3d normal, double finest) const override;
  /// Range-scan form: distance from the y axis at angle `alpha` and height `t` (0 bottom, 1 top) of
  /// range_height().
  double range_radius(double alpha, double t) const;
  static constexpr double range_height() { return 0.3; }

 private:
  struct Lobe {
    Vec3d centre;
    double size, sharpness;
  };
  double radius(Vec3d direction) const;
  std::uint32_t seed_;
  double twist_, bend_, stretch_;
  std::vector<Lobe> lobes_;
  std::array<Vec3d, 4> palette_;
};

/// An owl of painted and glazed clay on a plinth: whole, closed, with relief.
std::unique_ptr<ScanShape> make_owl(std::uint32_t seed);

/// A mesh with its atlas.
struct ScanMesh {
  Mesh mesh;                           // one wedge per position and chart
  std::vector<Vec3d> surface, normal;  // per position, before measuring noise
  std::vector<std::uint32_t> chart;    // per triangle
  std::uint32_t chart_count = 0;
};
ScanMesh make_scan_mesh(const ScanShape& shape, const ScanOptions& options);

/// Normal and occlusion-roughness-metallic maps are empty unless asked for.
struct ScanTextures {
  Pixels base_colour, normal, orm;
};
ScanTextures paint_atlas(const ScanShape& shape, const ScanMesh& scan, const ScanOptions& options,
                         const RunContext& context);

std::vector<std::uint8_t> encode_scan_jpeg(const Pixels& pixels, int quality);

/// All of it: mesh, one material, JPEG images.
Model make_scan(const ScanOptions& options, const RunContext& context);

/// The range-scan form: radii of a cylindrical scanner (0 = no sample) and the colour of every sample.
struct MadeRangeScan {
  std::uint32_t columns = 0, rows = 0;
  std::vector<float> radius;
  double height = 0;
  Pixels colour;
};
MadeRangeScan make_range_scan(const ScanOptions& options, const RunContext& context);

// Write a made scan to disk; InputError when a file cannot be written. Files beside the named one (MTL,
// textures, grid) take its stem.

void write_scan_glb(const Model& model, const std::string& path);
void write_scan_obj(const Model& model, const std::string& path);
/// Binary PLY with texture coordinates per face and a TextureFile comment (base colour only), as MeshLab
/// writes it.
void write_scan_ply(const Model& model, const std::string& path);
/// JSON, a 16-bit PGM grid and a JPEG; see schemas/range-scan.v1.schema.json.
void write_range_scan(const MadeRangeScan& scan, int jpeg_quality, const std::string& path);

}  // namespace texmesh
