// What perceptual values cost: each model is conditioned, filtered and simplified, then measured; the share
// of simplification's time tells apart a slow machine from a slow stage. --growth makes one shape at rising
// triangle counts and fits the exponent. --tables prints Table 7.1, 7.2 and the relative distances of a
// model.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include "format/base/portable_math.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/condition/condition.h"
#include "stages/perceptual_values/perceptual_values.h"
#include "stages/simplification/simplification.h"
#include "stages/skeletonization/skeletonization.h"
#include "stages/ssf/ssf.h"
#include "tests/bench/growth.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Distance to the middle, floored: what R is matters to the values, not to the time.
Skeleton stand_in(const Mesh& mesh) {
  Skeleton s;
  Vec3d middle;
  for (Vec3f p : mesh.positions)
    middle = middle + to_double(p) * (1 / static_cast<double>(mesh.positions.size()));
  for (Vec3f p : mesh.positions) s.distance.push_back(static_cast<float>(length(to_double(p) - middle)));
  const float most = *std::max_element(s.distance.begin(), s.distance.end());
  for (float d : s.distance) s.radius.push_back(std::max(d, most / 4));
  return s;
}

/// Persistence drawn at random, as many scales as the default: a scale map in no time.
ScaleMap random_map(const Mesh& mesh) {
  ScaleMap map;
  map.scales = 20;
  std::uint64_t state = 5;
  for (std::size_t p = 0; p < mesh.positions.size(); ++p) {
    int i = 0;
    for (; i < map.scales; ++i) {
      state = state * 6364136223846793005ull + 1442695040888963407ull;
      if (static_cast<double>(state >> 33) / 2147483648.0 > 0.83) break;
    }
    map.persistence.push_back(static_cast<std::uint8_t>(i));
  }
  return map;
}

struct Cost {
  std::size_t triangles = 0, scales = 0;
  double simplify_s = 0, measure_s = 0;
};

Cost measure(const ConditionedMesh& mesh, const Skeleton& skeleton, const ScaleMap& map,
             const RunContext& context, PerceptualValues& values) {
  Cost cost;
  auto start = Clock::now();
  const NestedScales scales = simplify(mesh, map, {}, context);
  cost.simplify_s = seconds_since(start);
  start = Clock::now();
  values = measure_perceptual_values(scales, skeleton, {}, context);
  cost.measure_s = seconds_since(start);
  cost.triangles = mesh.mesh.triangles.size();
  cost.scales = scales.scales.size();
  return cost;
}

void print(const char* name, const Cost& c) {
  std::printf("%-24s %9zu triangles %3zu scales  simplification %6.2f s  perceptual values %6.2f s\n", name,
              c.triangles, c.scales, c.simplify_s, c.measure_s);
  std::fflush(stdout);
}

void print_tables(const PerceptualValues& v) {
  const std::size_t n = v.step.size();
  const std::vector<float> average = cumulative_table(v.step, PerceptualStatistic::kAverage),
                           most = cumulative_table(v.step, PerceptualStatistic::kConservative);
  std::printf("%5s %9s %9s %9s %9s %9s %9s | %9s %9s | %9s %9s %5s\n", "scale", "mean", "max", "min", "std",
              "sum", "rss", "cum avg", "cum max", "p95", "p99", "major");
  for (std::size_t k = 1; k < n; ++k)
    std::printf("%5zu %9.4f %9.4f %9.2g %9.4f %9.1f %9.3f | %9.4f %9.4f | %9.4f %9.4f %5s\n", k,
                static_cast<double>(v.step[k].mean), static_cast<double>(v.step[k].max),
                static_cast<double>(v.step[k].min), static_cast<double>(v.step[k].deviation),
                static_cast<double>(v.step[k].sum), static_cast<double>(v.step[k].rss),
                static_cast<double>(average[k]), static_cast<double>(most[k]), static_cast<double>(v.p95[k]),
                static_cast<double>(v.p99[k]), v.major[k] ? "yes" : "");
}

void measure_model(const std::string& path, bool tables, const RunContext& context) {
  FileResolver resolver(std::filesystem::path(path).parent_path());
  const ImportedModel m = import_model(std::filesystem::path(path).filename().string(),
                                       read_input_file(path, std::uint64_t{1} << 33), resolver, {}, context);
  const ConditionedMesh mesh =
      condition_mesh(m.model.mesh, m.normals_by_specification, ConditionOptions{}, context);
  PerceptualValues values;
  const Skeleton skeleton = skeletonize(mesh, {}, context);
  print(std::filesystem::path(path).stem().string().c_str(),
        measure(mesh, skeleton, filter_scale_space(mesh, {}, context), context, values));
  if (tables) print_tables(values);
}

Mesh bumpy_ball(double triangles) {
  const auto rings = static_cast<std::uint32_t>(std::sqrt(triangles / 3)), segments = rings * 3 / 2;
  Mesh m;
  m.part_names = {"part"};
  for (std::uint32_t i = 0; i <= rings; ++i)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const double a = portable::kPi * (static_cast<double>(i) / rings - 0.5),
                   b = 2 * portable::kPi * j / segments;
      const double r = 1 + 0.02 * portable::sin(23 * a) * portable::cos(17 * b);
      const double ring = std::max(portable::cos(a), 0.0);
      m.wedge_position.push_back(static_cast<std::uint32_t>(m.positions.size()));
      m.positions.push_back(
          to_float(Vec3d{ring * portable::cos(b), portable::sin(a), ring * portable::sin(b)} * r));
    }
  for (std::uint32_t i = 0; i < rings; ++i)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const std::uint32_t k = (j + 1) % segments, a = i * segments + j, b = i * segments + k;
      m.triangles.push_back({a, a + segments, b + segments});
      m.triangles.push_back({a, b + segments, b});
    }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  return m;
}

void print_growth(double largest, const RunContext& context) {
  std::vector<double> x, y;
  for (double triangles = 125e3; triangles <= largest * 1.01; triangles *= 2) {
    const ConditionedMesh mesh = condition_mesh(bumpy_ball(triangles), true, {}, context);
    PerceptualValues values;
    const Cost c = measure(mesh, stand_in(mesh.mesh), random_map(mesh.mesh), context, values);
    print("bumpy ball", c);
    x.push_back(static_cast<double>(c.triangles));
    y.push_back(c.measure_s);
  }
  if (x.size() > 1) std::printf("exponent %.2f\n", growth_exponent(x, y));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Perceptual values: time, growth, tables"};
  std::vector<std::string> models;
  RunContext context;
  double growth = 0;
  bool tables = false;
  app.add_option("MODEL", models, "models to measure");
  app.add_option("--threads", context.threads, "threads")->capture_default_str();
  app.add_option("--growth", growth, "largest triangle count of the growth series, 0 = none");
  app.add_flag("--tables", tables, "the tables of each model");
  CLI11_PARSE(app, argc, argv);
  try {
    for (const std::string& model : models) measure_model(model, tables, context);
    if (growth > 0) print_growth(growth, context);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
