#include "lab/experiment/stimuli.h"

#include <algorithm>
#include <cmath>

#include "format/base/box.h"
#include "format/base/errors.h"
#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "tools/extract/package_model.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kRings = 72, kSegments = 144;
constexpr int kPatterns = 6, kPatternWaves = 14, kReliefWaves = 5;
constexpr std::size_t kMostScales = 10, kLeastScales = 3;
constexpr double kLeastScaleLevel = 0.005, kMostScaleLevel = 0.4;

Vec3d random_direction(SplitMix& random) {
  const double z = random.between(-1, 1), angle = random.between(0, 2 * portable::kPi);
  const double r = std::sqrt(1 - z * z);
  return {r * portable::cos(angle), r * portable::sin(angle), z};
}

StimulusShape::Wave random_wave(SplitMix& random, double least, double most, double height) {
  const Vec3d towards = random_direction(random) * random.between(least, most);
  return {towards, random.between(0, 2 * portable::kPi), height};
}

double sum_of(const std::vector<StimulusShape::Wave>& waves, Vec3d direction) {
  double sum = 0;
  for (const StimulusShape::Wave& w : waves)
    sum += w.height * portable::cos(dot(w.towards, direction) + w.phase);
  return sum;
}

/// At least one axis changes: one, two or none is exempt.
Vec3d random_axes(SplitMix& random) {
  Vec3d out{1, 1, 1};
  const std::size_t exempt = random.below(3);
  while (out.x + out.y + out.z > 3 - static_cast<double>(exempt)) out[static_cast<int>(random.below(3))] = 0;
  return out;
}

/// One of the six patterns: how fine its noise is, and its tint.
void draw_pattern(StimulusShape& shape, int number, SplitMix& random) {
  const double frequency = 7 + 2.5 * (number % kPatterns);
  for (int k = 0; k < kPatternWaves; ++k)
    shape.pattern.push_back(
        random_wave(random, frequency, 1.3 * frequency, std::sqrt(2.0 / kPatternWaves) * 0.22));
  constexpr std::array<Vec3d, kPatterns> kTints{
      {{.42, .38, .33}, {.30, .38, .44}, {.36, .43, .32}, {.46, .36, .36}, {.40, .40, .40}, {.44, .42, .28}}};
  shape.tint = kTints[static_cast<std::size_t>(number % kPatterns)];
}

std::vector<Vec3d> grid_directions() {
  std::vector<Vec3d> out;
  for (std::uint32_t r = 0; r <= kRings; ++r)
    for (std::uint32_t s = 0; s < kSegments; ++s) {
      const double polar = portable::kPi * r / kRings, turn = 2 * portable::kPi * s / kSegments;
      const double ring = r == 0 || r == kRings ? 0 : portable::sin(polar);
      out.push_back({ring * portable::cos(turn), portable::cos(polar), -ring * portable::sin(turn)});
    }
  return out;
}

std::vector<Triangle> grid_triangles() {
  std::vector<Triangle> out;
  for (std::uint32_t r = 0; r < kRings; ++r)
    for (std::uint32_t s = 0; s < kSegments; ++s) {
      const std::uint32_t next = (s + 1) % kSegments;
      const std::uint32_t a = r * kSegments + s, b = (r + 1) * kSegments + s, c = (r + 1) * kSegments + next,
                          d = r * kSegments + next;
      if (r + 1 < kRings) out.push_back({a, b, c});
      if (r > 0) out.push_back({a, c, d});
    }
  return out;
}

void smooth_normals(Mesh& mesh) {
  std::vector<Vec3d> sums(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = to_double(mesh.positions[t[0]]), b = to_double(mesh.positions[t[1]]),
                c = to_double(mesh.positions[t[2]]);
    for (const std::uint32_t v : t) sums[v] = sums[v] + cross(b - a, c - a);
  }
  // The corners of a pole are one place.
  for (const std::size_t ring : {std::size_t{0}, std::size_t{kRings}}) {
    Vec3d all;
    for (std::size_t s = 0; s < kSegments; ++s) all = all + sums[ring * kSegments + s];
    for (std::size_t s = 0; s < kSegments; ++s) sums[ring * kSegments + s] = all;
  }
  for (const Vec3d& n : sums) mesh.normals.push_back(to_float(normalized(n)));
}

/// Its pole's corners stand at one place.
Vec3d shape_point(const StimulusShape& shape, Vec3d direction, double change) {
  const double radius = 1 + sum_of(shape.relief, direction);
  Vec3d p = direction * radius;
  for (int k = 0; k < 3; ++k) p[k] *= shape.axes[k] * (1 + change * shape.changes[k]);
  return p;
}

/// Scales the axes until the longest side is 2.
void normalise(StimulusShape& shape) {
  std::vector<Vec3f> points;
  for (const Vec3d& d : grid_directions()) points.push_back(to_float(shape_point(shape, d, 0)));
  const double longest = bounding_box(points).longest_side();
  shape.axes = shape.axes * (2 / longest);
}

RenderedModel shape_model(const StimulusShape& shape, double change) {
  RenderedModel model;
  model.mesh = shape_mesh(shape, change);
  RenderMaterial material;
  material.metallic = 0, material.roughness = 0.55f;
  model.materials.push_back(material);
  return model;
}

/// Scales of the package whose values serve, spread evenly over the logarithm of the values, fine to coarse.
std::vector<ManifestScale> chosen_scales(PackageReader& package) {
  std::vector<ManifestScale> fit;
  for (const ManifestScale& s : package.manifest().scales)
    if (s.p95 >= kLeastScaleLevel && s.p95 <= kMostScaleLevel) fit.push_back(s);
  std::ranges::stable_sort(fit, {}, &ManifestScale::p95);
  const auto same = [](const ManifestScale& a, const ManifestScale& b) { return b.p95 < a.p95 * 1.02; };
  fit.erase(std::unique(fit.begin(), fit.end(), same), fit.end());
  while (fit.size() > kMostScales) {
    std::size_t closest = 1;
    for (std::size_t k = 2; k + 1 < fit.size(); ++k)
      if (fit[k + 1].p95 / fit[k - 1].p95 < fit[closest + 1].p95 / fit[closest - 1].p95) closest = k;
    fit.erase(fit.begin() + static_cast<std::ptrdiff_t>(closest));
  }
  if (fit.size() < kLeastScales)
    throw InputError(package.store().name(), "", "at least 3 scales whose change is between 0.005 and 0.4",
                     std::to_string(fit.size()) + " (texmesh dump lists them as p95)");
  return fit;
}

void squeeze(RenderedModel& model, Vec3d centre) {
  for (Vec3f& p : model.mesh.positions)
    p.y = static_cast<float>(centre.y + (static_cast<double>(p.y) - centre.y) * (1 - kCatchLevel));
}

}  // namespace

std::vector<StimulusShape> draw_shapes(StimulusKind kind, int count, std::uint64_t seed) {
  SplitMix random(seed);
  std::vector<StimulusShape> out;
  for (int k = 0; k < count; ++k) {
    StimulusShape shape;
    for (int axis = 0; axis < 3; ++axis) shape.axes[axis] = random.between(0.55, 1);
    if (kind == StimulusKind::kQuadrics) {
      for (int w = 0; w < kReliefWaves; ++w) shape.relief.push_back(random_wave(random, 1.5, 4, 0.07));
      shape.changes = {0, 0, 1};
    } else {
      shape.changes = random_axes(random);
    }
    draw_pattern(shape, k, random);
    normalise(shape);
    out.push_back(std::move(shape));
  }
  return out;
}

Mesh shape_mesh(const StimulusShape& shape, double change) {
  Mesh mesh;
  mesh.part_names = {""};
  for (const Vec3d& d : grid_directions()) {
    mesh.wedge_position.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
    mesh.positions.push_back(to_float(shape_point(shape, d, change)));
    const double light = 1 + sum_of(shape.pattern, d) / 0.4;
    const auto channel = [light](double tint) {
      return static_cast<float>(std::clamp(tint * light, 0.02, 0.9));
    };
    mesh.colours.push_back({channel(shape.tint.x), channel(shape.tint.y), channel(shape.tint.z), 1});
  }
  mesh.triangles = grid_triangles();
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  mesh.triangle_part.assign(mesh.triangles.size(), 0);
  smooth_normals(mesh);
  return mesh;
}

StimulusSet shape_stimuli(const ExperimentOptions& options) {
  const auto shapes = std::make_shared<std::vector<StimulusShape>>(
      draw_shapes(options.kind, options.objects, SplitMix(options.seed).bits()));
  StimulusSet set;
  set.objects = shapes->size();
  set.levels = options.levels;
  double reach = 0;
  for (const StimulusShape& shape : *shapes)
    for (const Vec3f& p : shape_mesh(shape, set.levels.back()).positions)
      reach = std::max(reach, length(to_double(p)));
  set.radius = reach;
  // A change grows or shrinks; which of them, judges cannot learn.
  std::vector<double> signs;
  SplitMix random(~options.seed);
  for (std::size_t k = 0; k < set.objects * set.levels.size(); ++k) signs.push_back(random.below(2) ? 1 : -1);
  set.shown = [shapes, signs, levels = set.levels](std::size_t object, std::size_t level) {
    double change = 0;
    if (level > levels.size())
      change = -kCatchLevel;
    else if (level > 0)
      change = signs[object * levels.size() + level - 1] * levels[level - 1];
    return StimulusSet::Shown{shape_model((*shapes)[object], change), nullptr};
  };
  return set;
}

StimulusSet package_stimuli(PackageReader& package, const RunContext& context) {
  const std::vector<ManifestScale> scales = chosen_scales(package);
  const auto finest = std::make_shared<RenderedModel>(package_model(package, {}, context));
  StimulusSet set;
  std::vector<int> numbers{0};
  for (const ManifestScale& s : scales) set.levels.push_back(s.p95), numbers.push_back(s.scale);
  numbers.push_back(package.manifest().scales.back().scale);
  set.centre = finest->bounds.centre;
  set.radius = finest->bounds.radius;
  set.object_height = package.manifest().object_height;
  set.shown = [&package, finest, numbers, context](std::size_t, std::size_t level) {
    StimulusSet::Shown shown{package_scale(package, numbers[level], *finest, context), &finest->textures};
    if (level + 1 == numbers.size()) squeeze(shown.model, finest->bounds.centre);
    return shown;
  };
  return set;
}

}  // namespace texmesh
