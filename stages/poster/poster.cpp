#include "stages/poster/poster.h"

#include "format/base/portable_math.h"
#include "format/rules/first_look.h"
#include "stages/jpeg/jpeg.h"
#include "stages/poster/poster_camera.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

/// The logarithm of what IJG multiplies its quantisers by, in percent.
double log_of_scale(int quality) {
  return portable::log(quality < 50 ? 5000.0 / quality : std::max(1.0, 200.0 - 2 * quality));
}

/// The file of the highest quality that fits; empty where none does. Bytes fall with a power of the scale of
/// the quantisers, which the last two files tell: that takes four files where halves of the range take seven.
Bytes best_jpeg(const Pixels& pixels, std::size_t max_bytes) {
  constexpr int kFirst = 88, kGuesses = 5;
  constexpr double kSlope = -0.6, kSteepest = -1.2, kFlattest = -0.3;
  Bytes best;
  double slope = kSlope, last_over = 0, last_scale = 0;
  int quality = kFirst;
  for (int low = 1, high = 100, tries = 1; low <= high; ++tries) {
    Bytes file = encode_jpeg(pixels, quality, Subsampling::k420);
    const double over = portable::log(static_cast<double>(file.size()) / static_cast<double>(max_bytes)),
                 scale = log_of_scale(quality);
    if (last_scale != 0 && scale != last_scale)
      slope = std::clamp((over - last_over) / (scale - last_scale), kSteepest, kFlattest);
    last_over = over, last_scale = scale;
    if (file.size() <= max_bytes) {
      best = std::move(file);
      low = quality + 1;
    } else {
      high = quality - 1;
    }
    // The highest quality whose scale is expected to fit.
    const double wanted = tries < kGuesses ? scale - over / slope : log_of_scale((low + high) / 2);
    for (quality = high; quality > low && log_of_scale(quality) < wanted;) --quality;
  }
  return best;
}

constexpr std::size_t kCoarseTriangles = 2000;

const NestedScale& coarse_scale(const NestedScales& scales) {
  const auto few = [](const NestedScale& s) { return s.triangles.size() <= kCoarseTriangles; };
  const auto found = std::find_if(scales.scales.begin(), scales.scales.end(), few);
  return found == scales.scales.end() ? scales.scales.back() : *found;
}

constexpr double kMargin = 0.04;  // of the picture's side
constexpr std::uint32_t kTrialSide = 48;
constexpr double kTiny = 0.02;     // of the trial's pixels: less than a thread would cover
constexpr double kStrays = 0.005;  // share of positions that may be strays, on each side

struct Direction {
  double azimuth_degrees, elevation_degrees, weight;
};
// First the one that viewers begin with; the others must show much more to be taken.
constexpr std::array<Direction, 8> kDirections{{{kFirstLookAzimuthDegrees, kFirstLookElevationDegrees, 1},
                                                {-28, 18, 0.9},
                                                {30, 40, 0.7},
                                                {-30, 40, 0.7},
                                                {30, 75, 0.35},
                                                {150, 15, 0.5},
                                                {-150, 15, 0.5},
                                                {30, -50, 0.3}}};

double radians(double degrees) { return degrees * portable::kPi / 180; }

struct Frame {
  Vec3d x, y, z;
};

Frame frame_of(const Direction& d) {
  const double azimuth = radians(d.azimuth_degrees), elevation = radians(d.elevation_degrees);
  const double ring = portable::cos(elevation);
  Frame f;
  f.z = {ring * portable::sin(azimuth), portable::sin(elevation), ring * portable::cos(azimuth)};
  f.x = normalized(cross(Vec3d{0, 1, 0}, f.z));
  f.y = cross(f.z, f.x);
  return f;
}

/// The value that the share `left_out` of all values exceeds.
double high_end(std::vector<double>& values, double left_out) {
  const auto skipped = static_cast<std::size_t>(left_out * static_cast<double>(values.size()));
  const auto at = values.end() - 1 - static_cast<std::ptrdiff_t>(std::min(skipped, values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<Vec3d> positions_of(const RenderScene& scene) {
  const Mesh& mesh = *scene.mesh;
  std::vector<std::uint8_t> used(mesh.positions.size(), 0);
  for (const Triangle& t : *scene.triangles)
    for (std::size_t k = 0; k < 3; ++k) used[mesh.wedge_position[t[k]]] = 1;
  std::vector<Vec3d> positions;
  for (std::size_t p = 0; p < used.size(); ++p)
    if (used[p]) positions.push_back(to_double(mesh.positions[p]));
  return positions;
}

std::size_t covered_pixels(const RenderScene& scene, const RenderCamera& camera, const RunContext& context) {
  const Visibility view = look(scene, camera, kTrialSide, context);
  std::size_t covered = 0;
  for (std::size_t p = 0; p + 1 < view.first.size(); ++p) covered += view.first[p] < view.first[p + 1];
  return covered;
}

}  // namespace

Poster make_poster(const NestedScales& scales, const std::vector<Material>& materials,
                   const Fragments& fragments, const std::vector<Pixels>& pixels,
                   const PosterOptions& options, const RunContext& context) {
  if (options.size_px == 0) return {};
  if (scales.scales.empty()) throw StageError("poster", "scales", "S_0", "none");
  RunContext inner = context;
  inner.progress = nullptr;
  const auto wanted_px = static_cast<std::uint32_t>(options.size_px);
  const ShownMaterials shown =
      shown_materials(materials, fragments, pixels, scales.mesh, 2 * wanted_px, inner);
  const auto scene_of = [&](const NestedScale& scale) {
    return RenderScene{&scales.mesh, &scale.triangles, &scale.triangle_source, &shown.materials,
                       shown.textures.size()};
  };
  const RenderScene scene = scene_of(scales.scales.front());
  const RenderCamera camera = poster_camera(scene, scene_of(coarse_scale(scales)), inner);
  const RenderEnvironment environment = daylight_environment(
      to_float(camera.x), to_float(camera.y), to_float(camera.z),
      std::any_of(materials.begin(), materials.end(), [](const Material& m) { return m.metallic > 0.5f; }));
  for (std::uint32_t side_px = wanted_px;; side_px /= 2) {
    context.check_cancelled();
    const Picture picture =
        shade(scene, look(scene, camera, side_px, inner), shown.textures, environment, inner);
    Poster result{best_jpeg(encode_srgb(picture), static_cast<std::size_t>(options.max_bytes)), side_px,
                  side_px};
    if (!result.file.empty()) {
      context.report(1);
      return result;
    }
    if (side_px == 1)
      throw StageError("poster", "the file", "at most " + std::to_string(options.max_bytes) + " bytes",
                       "more");
  }
}

// A position at (a, b, d) of the frame lies in the picture of a camera at (u, v, D) where |a - u| and |b - v|
// are at most t (D - d). That makes u + t D the largest a + t d, and t D - u the largest t d - a.
RenderCamera fitted_camera(const std::vector<Vec3d>& positions, Vec3d x, Vec3d y, Vec3d z, double left_out) {
  RenderCamera camera = perspective_camera({x, y, z, {0, 0, 0}, 1});
  const double t = camera.tan_half_fov * (1 - 2 * kMargin);
  std::array<std::vector<double>, 4> ends;
  double nearest = 0, farthest = 0;
  for (const Vec3d p : positions) {
    const double a = dot(p, x), b = dot(p, y), d = dot(p, z);
    if (!std::isfinite(a) || !std::isfinite(b) || !std::isfinite(d)) continue;
    nearest = ends[0].empty() ? d : std::max(nearest, d);
    farthest = ends[0].empty() ? d : std::min(farthest, d);
    ends[0].push_back(a + t * d);
    ends[1].push_back(t * d - a);
    ends[2].push_back(b + t * d);
    ends[3].push_back(t * d - b);
  }
  if (ends[0].empty()) return camera;
  std::array<double, 4> high{};
  for (std::size_t k = 0; k < 4; ++k) high[k] = high_end(ends[k], left_out);
  const double half = std::max(high[0] + high[1], high[2] + high[3]) / 2;
  const double depth = nearest - farthest;
  // A single position, or all on the line of sight: any distance will do.
  double away = half / t;
  if (left_out == 0) away = std::max(away, nearest + std::max(depth, 1e-6) * 0.01);
  camera.eye = x * ((high[0] - high[1]) / 2) + y * ((high[2] - high[3]) / 2) + z * away;
  camera.near = std::max(left_out == 0 ? (away - nearest) / 2 : half / 1000, 1e-12);
  return camera;
}

RenderCamera first_look(const std::vector<Vec3d>& positions, Vec3d direction) {
  Box3d box;
  for (const Vec3d p : positions)
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) box.extend(p);
  if (box.empty()) box.extend(Vec3d{});
  const double radius = std::max(box.diagonal() / 2, 1e-9);
  const double distance = radius / portable::sin(radians(kFirstLookFovDegrees) / 2);
  return look_at_camera(box.centre() + direction * distance, box.centre(), {0, 1, 0}, kFirstLookFovDegrees,
                        distance / 500);
}

RenderCamera poster_camera(const RenderScene& scene, const RenderScene& coarse, const RunContext& context) {
  const std::vector<Vec3d> positions = positions_of(scene);
  RenderCamera best;
  for (const bool strays : {false, true}) {
    double most = -1;
    for (const Direction& direction : kDirections) {
      context.check_cancelled();
      const Frame f = frame_of(direction);
      const RenderCamera camera =
          strays ? fitted_camera(positions, f.x, f.y, f.z, kStrays) : first_look(positions, f.z);
      const double score = static_cast<double>(covered_pixels(coarse, camera, context)) * direction.weight;
      if (score > most) most = score, best = camera;
    }
    if (most > kTiny * kTrialSide * kTrialSide) break;
  }
  return best;
}

}  // namespace texmesh
