// Pictures and scans that are made by code: the thesis's own are not available.
#include "lab/thesis/made_models.h"

#include <nlohmann/json.hpp>

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "lab/study/fragment_study.h"
#include "pipeline/import/import.h"
#include "stages/base/parallel.h"
#include "stages/condition/condition.h"
#include "stages/image/png_writer.h"
#include "stages/ladder/ladder.h"
#include "stages/previews/previews.h"
#include "stages/simplification/simplification.h"
#include "stages/ssf/ssf.h"

namespace texmesh {
namespace {

enum class Form { kPlain, kRamp, kSoft, kStripes, kBoard, kDots, kGrain, kMixed };

struct Pattern {
  const char* text;
  Form form;
  double ground, contrast;  // 0..1
  double size_px;
  double hue;  // how much the channels differ, 0..1
};

constexpr std::array<Pattern, kMadePatterns> kPatterns{{
    {"plain, dark", Form::kPlain, 0.15, 0, 1, 0},
    {"ramp, middle", Form::kRamp, 0.40, 0.5, 64, 0.1},
    {"soft, bright", Form::kSoft, 0.75, 0.15, 32, 0.1},
    {"plain, bright", Form::kPlain, 0.85, 0, 1, 0.1},
    {"soft, dark", Form::kSoft, 0.25, 0.2, 24, 0},
    {"soft, middle", Form::kSoft, 0.5, 0.35, 16, 0.2},
    {"wide stripes, dark", Form::kStripes, 0.3, 0.3, 16, 0.1},
    {"wide stripes, bright", Form::kStripes, 0.7, 0.3, 16, 0.1},
    {"irregular, dark", Form::kSoft, 0.30, 0.36, 5, 0.3},
    {"irregular, bright", Form::kSoft, 0.60, 0.72, 5, 0.3},
    {"dots, dark", Form::kDots, 0.25, 0.4, 16, 0.2},
    {"edges, dark ground", Form::kBoard, 0.25, 0.45, 16, 0},
    {"ramp, colours", Form::kRamp, 0.5, 0.6, 32, 0.8},
    {"grooves, dark", Form::kStripes, 0.25, 0.30, 6, 0.1},
    {"dots, bright", Form::kDots, 0.75, 0.45, 16, 0.2},
    {"grooves, bright", Form::kStripes, 0.50, 0.60, 6, 0.1},
    {"edges, middle ground", Form::kBoard, 0.4, 0.5, 12, 0.2},
    {"grain, dark", Form::kGrain, 0.35, 0.4, 1, 0.2},
    {"sharp edges, bright ground", Form::kBoard, 0.65, 0.7, 20, 0.1},
    {"grain, bright", Form::kGrain, 0.65, 0.6, 1, 0.2},
    {"mixed, dark", Form::kMixed, 0.35, 0.5, 10, 0.5},
    {"mixed, bright", Form::kMixed, 0.65, 0.6, 10, 0.5},
    {"narrow board", Form::kBoard, 0.5, 0.9, 4, 0.3},
    {"eyes, colours", Form::kMixed, 0.6, 1.0, 12, 1.0},
}};

/// -0.5..0.5
double form_value(const Pattern& p, double x, double y, std::uint32_t seed) {
  const auto cell = [&](double v) { return static_cast<int>(std::floor(v / p.size_px)); };
  const double noise = lattice_noise(x / p.size_px, y / p.size_px, seed) - 0.5;
  switch (p.form) {
    case Form::kPlain:
      return 0;
    case Form::kRamp:
      return x / kPatternPx - 0.5;
    case Form::kSoft:
      return noise;
    case Form::kStripes:
      return 0.5 * portable::sin(2 * portable::kPi * x / p.size_px);
    case Form::kBoard:
      return (cell(x) + cell(y)) % 2 == 0 ? 0.5 : -0.5;
    case Form::kDots: {
      const double u = x - p.size_px * (cell(x) + 0.5), v = y - p.size_px * (cell(y) + 0.5);
      return u * u + v * v < 0.1 * p.size_px * p.size_px ? 0.5 : -0.2;
    }
    case Form::kGrain:
      return lattice_noise(7 * x + 0.5, 7 * y + 0.5, seed) - 0.5;
    case Form::kMixed:
      return 0.6 * noise + 0.3 * ((cell(x) + cell(y)) % 2) +
             0.4 * (lattice_noise(x / 2, y / 2, seed + 1) - 0.5) - 0.15;
  }
  return 0;
}

std::uint8_t pattern_value(std::size_t pattern, std::uint32_t x, std::uint32_t y, std::uint32_t channel) {
  const Pattern& p = kPatterns[pattern];
  // Dark and bright of a pair have the same form: the seed goes by form and size.
  const auto seed = static_cast<std::uint32_t>(100 * static_cast<int>(p.form) + static_cast<int>(p.size_px));
  const double tint = (lattice_noise(x / 16.0, y / 16.0, seed + 50 + channel) - 0.5) * p.hue * p.contrast;
  return static_cast<std::uint8_t>(
      255 * std::clamp(p.ground + p.contrast * form_value(p, x, y, seed) + tint, 0.0, 1.0) + 0.5);
}

}  // namespace

std::string pattern_name(std::size_t pattern) {
  return std::string("(") + static_cast<char>('a' + pattern) + ") " + kPatterns[pattern].text;
}

PatternPlane pattern_plane(const std::vector<std::size_t>& patterns, std::uint32_t columns) {
  TexturePlane plane =
      covered_plane(columns, static_cast<std::uint32_t>(patterns.size()) / columns, kPatternPx, kPatternPx);
  Pixels pixels{plane.width_px, plane.height_px, 3, {}};
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        pixels.data.push_back(pattern_value(patterns[y / kPatternPx * columns + x / kPatternPx],
                                            x % kPatternPx, y % kPatternPx, c));
  return {{0, {std::move(plane)}, {}}, {std::move(pixels)}};
}

LutTables plane_tables(const PatternPlane& plane, const std::vector<int>& rungs, const RunContext& context) {
  LadderOptions options;
  options.rungs = rungs;
  options.prune = false;
  const Previews previews = make_previews(plane.fragments, plane.pixels, {}, context);
  const Ladder ladder = encode_ladder(plane.fragments, plane.pixels, previews, {}, options, context);
  return build_tables(plane.fragments, plane.pixels,
                      predict_quality(plane.fragments, plane.pixels, kTexturePredictors, context), ladder,
                      previews, {}, context);
}

namespace {

constexpr double kLargestRadius_mm = 120, kObjectHeight_mm = 300;
constexpr std::uint32_t kShapeSeed = 7;

/// A smooth bump of height 1 around 0.
double bump(double x, double width) { return portable::exp(-(x / width) * (x / width)); }
/// Angle between two directions, -pi..pi.
double turned(double alpha, double towards) {
  double d = alpha - towards;
  while (d > portable::kPi) d -= 2 * portable::kPi;
  while (d < -portable::kPi) d += 2 * portable::kPi;
  return d;
}
/// Rises from 0 to 1 around `edge`.
double step_at(double x, double edge, double width) { return 1 / (1 + portable::exp(-(x - edge) / width)); }

/// What a scanner sees of a carved surface: -0.5..0.5, a grain of a few samples.
double rough(double alpha, double h, std::uint32_t seed) {
  const double x = 9 * portable::cos(alpha) + 20, z = 9 * portable::sin(alpha) + 20;
  return 0.5 * (lattice_noise(x, 38 * h, seed) + lattice_noise(z, 31 * h + 7, seed + 100)) - 0.5;
}

/// Prominent ears and cheeks, shallow eyes, a smooth back (thesis 2.2).
double head_radius(double alpha, double h) {
  const double across = 2 * h - 1.02;
  double r = 78 * std::sqrt(std::max(1 - across * across, 0.06));
  r -= 14 * step_at(0.22, h, 0.03);  // the neck
  r += 20 * bump(turned(alpha, 0), 0.16) * bump(h - 0.46, 0.07);
  for (const double side : {-1.0, 1.0}) {
    r += 22 * bump(turned(alpha, side * 1.6), 0.10) * bump(h - 0.48, 0.08);
    r += 7 * bump(turned(alpha, side * 0.55), 0.22) * bump(h - 0.40, 0.07);
    r -= 4 * bump(turned(alpha, side * 0.38), 0.12) * bump(h - 0.56, 0.035);
  }
  r += 3 * bump(turned(alpha, 0), 0.3) * bump(h - 0.32, 0.02);  // lips
  const double front = 0.35 + 0.65 * bump(turned(alpha, 0), 1.5);
  return r + 5 * front * rough(alpha, h, kShapeSeed);
}

/// Cylinders on each other: boots, belt, coat, collar, head, hat; arms at the sides.
double nutcracker_radius(double alpha, double h) {
  double r = 62;
  r -= 20 * step_at(h, 0.10, 0.012) * step_at(0.38, h, 0.015);  // legs
  r += 10 * bump(h - 0.40, 0.018);                              // belt
  r -= 14 * step_at(h, 0.62, 0.012);                            // collar
  r += 9 * bump(h - 0.63, 0.012);
  r -= 8 * step_at(h, 0.82, 0.01);
  r += 12 * bump(h - 0.83, 0.015);  // brim
  for (const double side : {-1.0, 1.0}) {
    r += 18 * bump(turned(alpha, side * 1.57), 0.16) * step_at(h, 0.38, 0.02) * step_at(0.60, h, 0.02);
    r -= 9 * bump(turned(alpha, side * 1.57), 0.35) * step_at(0.36, h, 0.02);
  }
  r -= 10 * bump(turned(alpha, 0), 0.14) * step_at(0.36, h, 0.02);  // between the legs
  r += 8 * bump(turned(alpha, 0), 0.12) * bump(h - 0.72, 0.025);    // nose
  r += 2.5 * portable::sin(12 * alpha) * step_at(h, 0.40, 0.03) * step_at(0.60, h, 0.03);
  return r + 2 * rough(alpha, h, kShapeSeed + 1);
}

constexpr double kMostGrid = 65535;

Bytes radius_file(MadeShape shape, std::uint32_t columns, std::uint32_t rows) {
  const std::string head = "P5\n" + std::to_string(columns) + " " + std::to_string(rows) + "\n65535\n";
  Bytes out(head.begin(), head.end());
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const double r =
          made_radius(shape, 2 * portable::kPi * x / columns, 1 - static_cast<double>(y) / (rows - 1));
      const auto value = static_cast<std::uint32_t>(kMostGrid * r / kLargestRadius_mm + 0.5);
      out.push_back(static_cast<std::uint8_t>(value >> 8));
      out.push_back(static_cast<std::uint8_t>(value));
    }
  return out;
}

}  // namespace

double lattice_noise(double x, double y, std::uint32_t seed) {
  const double x0 = std::floor(x), y0 = std::floor(y);
  const auto corner = [&](double i, double j) {
    return SplitMix(
               static_cast<std::uint64_t>(static_cast<std::int64_t>(x0 + i) - 1) * 0x9e3779b97f4a7c15ull +
               static_cast<std::uint64_t>(static_cast<std::int64_t>(y0 + j)) * 0xc2b2ae3d27d4eb4full + seed)
        .next();
  };
  const double u = x - x0, v = y - y0, su = u * u * (3 - 2 * u), sv = v * v * (3 - 2 * v);
  const double top = corner(0, 0) + su * (corner(1, 0) - corner(0, 0));
  const double bottom = corner(0, 1) + su * (corner(1, 1) - corner(0, 1));
  return top + sv * (bottom - top);
}

double made_radius(MadeShape shape, double alpha, double height) {
  return shape == MadeShape::kHead ? head_radius(alpha, height) : nutcracker_radius(alpha, height);
}

Pixels made_texture(std::uint32_t side_px, double contrast, std::uint32_t seed, const RunContext& context) {
  Pixels out{side_px, side_px, 3, std::vector<std::uint8_t>(std::size_t{side_px} * side_px * 3)};
  const double unit = 8.0 / side_px;
  const auto draw_row = [&](std::size_t y) {
    std::uint8_t* to = out.data.data() + y * side_px * 3;
    const double v = unit * static_cast<double>(y);
    for (std::uint32_t x = 0; x < side_px; ++x) {
      double value = 0, weight = 0.5;
      for (double f = 1; f * 8 < side_px; f *= 2, weight *= 0.62)
        value += weight * (lattice_noise(f * unit * x, f * v, seed + static_cast<std::uint32_t>(f)) - 0.5);
      const double hue = lattice_noise(unit * x, v, seed + 9999) - 0.5;
      for (const double tint : {0.22, 0.0, -0.22})
        *to++ =
            static_cast<std::uint8_t>(std::clamp(128 + 255 * contrast * (value + tint * hue), 0.0, 255.0));
    }
  };
  parallel_each(context, side_px, 16, [&](std::size_t y) { draw_row(y); });
  return out;
}

Model make_scan_model(MadeShape shape, std::uint32_t columns, std::uint32_t rows, std::uint32_t texture_px,
                      const RunContext& context) {
  MemoryFiles files;
  files.files["radius.pgm"] = radius_file(shape, columns, rows);
  nlohmann::json scan{{"version", 1},
                      {"type", "cylindrical-range-scan"},
                      {"grid", "radius.pgm"},
                      {"y_step", kObjectHeight_mm / (rows - 1)},
                      {"radius_scale", kLargestRadius_mm / kMostGrid}};
  if (texture_px > 0) {
    files.files["colour.png"] = write_png(made_texture(texture_px, 1, 11, context));
    scan["texture"] = "colour.png";
  }
  const std::string text = scan.dump();
  return import_range_scan("scan.json", Bytes(text.begin(), text.end()), files, {}, context).model;
}

RangeGrid made_ring(MadeShape shape, std::uint32_t samples, double height) {
  RangeGrid ring;
  ring.columns = samples, ring.rows = 1;
  ring.alpha_step_rad = static_cast<float>(2 * portable::kPi / samples);
  ring.y_step = 1;
  for (std::uint32_t k = 0; k < samples; ++k) {
    ring.radius.push_back(static_cast<float>(made_radius(shape, 2 * portable::kPi * k / samples, height)));
    ring.position.push_back(k);
  }
  return ring;
}

MadeChain thesis_chain(const Model& model, const RunContext& context) {
  MadeChain out;
  out.mesh = condition_mesh(model.mesh, false, {}, context);
  out.map = filter_range_scan(grid_on_conditioned(model.range, model.mesh.positions.size(), out.mesh),
                              out.mesh.mesh.positions.size(), {}, context);
  SimplificationOptions options;
  options.order = CollapseOrder::kThesis;
  options.max_error = options.max_shift = options.coarsest = 1;  // the scale map alone decides
  options.min_triangles = 1;
  options.coarsest_vertices = 0;
  out.scales = simplify(out.mesh, out.map, options, context);
  return out;
}

}  // namespace texmesh
