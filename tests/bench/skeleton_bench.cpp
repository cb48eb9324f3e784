// What skeleton and R cost and what they are like. Models: each file is conditioned and skeletonised with and
// without the correction by local thickness; the table shows how smooth R is (95th percentile of its change
// along an edge) and how much of it was corrected. Limbs: a ball with thin legs of known radius, R against
// it. Growth: one shape at rising triangle counts, with the exponent of a log-log fit.
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
#include "stages/skeletonization/skeletonization.h"
#include "tests/bench/growth.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double rank(std::vector<double> v, double fraction) {
  if (v.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(v.size() - 1));
  std::nth_element(v.begin(), v.begin() + at, v.end());
  return v[static_cast<std::size_t>(at)];
}

/// Change of R along edges, relative to the smaller R.
double jump(const Mesh& mesh, const std::vector<float>& radius) {
  std::vector<double> jumps;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto a = static_cast<double>(radius[mesh.position_of(t, k)]),
                 b = static_cast<double>(radius[mesh.position_of(t, (k + 1) % 3)]);
      jumps.push_back(std::fabs(a - b) / std::min(a, b));
    }
  return rank(jumps, 0.95);
}

Skeleton timed(const ConditionedMesh& mesh, const SkeletonizationOptions& options, const RunContext& context,
               double& seconds) {
  const auto start = Clock::now();
  Skeleton s = skeletonize(mesh, options, context);
  seconds = seconds_since(start);
  return s;
}

SkeletonizationOptions uncorrected() {
  SkeletonizationOptions options;
  options.plate_ratio = options.limb_ratio = 1e9;
  return options;
}

void print_model(const std::string& path, const RunContext& context) {
  FileResolver resolver(std::filesystem::path(path).parent_path());
  const ImportedModel m = import_model(std::filesystem::path(path).filename().string(),
                                       read_input_file(path, std::uint64_t{1} << 33), resolver, {}, context);
  const ConditionedMesh mesh =
      condition_mesh(m.model.mesh, m.normals_by_specification, ConditionOptions{}, context);
  double plain_s = 0, s = 0;
  const Skeleton plain = timed(mesh, uncorrected(), context, plain_s), skeleton = timed(mesh, {}, context, s);
  std::vector<double> r, before;
  std::size_t limited = 0;
  for (std::size_t p = 0; p < skeleton.distance.size(); ++p) {
    r.push_back(static_cast<double>(skeleton.distance[p]));
    before.push_back(static_cast<double>(plain.distance[p]));
    limited += skeleton.distance[p] < plain.distance[p];
  }
  std::printf("%-28s %9zu %7.2f %7.2f %6zu %8.3g %8.3g %7.1f %8.1f %8.1f",
              std::filesystem::path(path).stem().string().c_str(), mesh.mesh.triangles.size(), plain_s, s,
              skeleton.segments.size(), rank(before, 0.5), rank(r, 0.5),
              100.0 * static_cast<double>(limited) / static_cast<double>(r.size()),
              100 * jump(mesh.mesh, plain.radius), 100 * jump(mesh.mesh, skeleton.radius));
  for (const Note& n : skeleton.notes) std::printf("  %s", n.code.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

Mesh tube_mesh() {
  Mesh m;
  m.part_names = {"part"};
  return m;
}

/// A closed surface of revolution around y: radii at heights, `segments` around.
void add_revolution(const std::vector<std::pair<double, double>>& profile, Vec3d at, std::uint32_t segments,
                    Mesh& m) {
  const auto first = static_cast<std::uint32_t>(m.positions.size());
  for (const auto& [y, r] : profile)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const double a = 2 * portable::kPi * j / segments;
      m.positions.push_back(to_float(at + Vec3d{r * portable::cos(a), y, r * portable::sin(a)}));
    }
  for (std::uint32_t i = 0; i + 1 < profile.size(); ++i)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const std::uint32_t k = (j + 1) % segments, a = first + i * segments + j, b = first + i * segments + k;
      m.triangles.push_back({a, a + segments, b + segments});
      m.triangles.push_back({a, b + segments, b});
    }
}

void finish(Mesh& m) {
  for (std::uint32_t p = 0; p < m.positions.size(); ++p) m.wedge_position.push_back(p);
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
}

std::vector<std::pair<double, double>> ball(double radius, int rings, double bumps) {
  std::vector<std::pair<double, double>> profile;
  for (int i = 0; i <= rings; ++i) {
    const double a = portable::kPi * (static_cast<double>(i) / rings - 0.5);
    const double r = radius * (1 + bumps * portable::sin(9 * a));
    profile.emplace_back(r * portable::sin(a), std::max(r * portable::cos(a), 0.0));
  }
  return profile;
}

/// R on the legs of a ball over the legs' own radius: 1 is right, and without correction it is what it is.
void print_limbs(double leg, const RunContext& context) {
  Mesh m = tube_mesh();
  add_revolution(ball(1, 60, 0), {}, 80, m);
  const std::size_t body = m.positions.size();
  for (int k = 0; k < 4; ++k) {
    std::vector<std::pair<double, double>> profile;
    profile.emplace_back(-2.2, 0.0);
    for (int i = 0; i <= 30; ++i) profile.emplace_back(-2.2 + 1.4 * i / 30, leg);
    profile.emplace_back(-0.8, 0.0);
    add_revolution(profile, {k % 2 ? 0.4 : -0.4, 0, k / 2 ? 0.4 : -0.4}, 16, m);
  }
  finish(m);
  const ConditionedMesh mesh = condition_mesh(m, true, {}, context);
  const auto ratio = [&](const Skeleton& s) {
    std::vector<double> r;
    for (std::size_t p = 0; p < mesh.mesh.positions.size(); ++p)
      if (mesh.position_source[p] >= body && mesh.mesh.positions[p].y < -1.3f &&
          mesh.mesh.positions[p].y > -2.1f)
        r.push_back(static_cast<double>(s.distance[p]) / leg);
    return std::pair{rank(r, 0.5), rank(r, 0.95)};
  };
  const auto before = ratio(skeletonize(mesh, uncorrected(), context)),
             after = ratio(skeletonize(mesh, {}, context));
  std::printf(
      "legs of radius %.3f (diagonal / %3.0f): R / radius  p50 %5.2f p95 %5.2f  corrected  p50 %5.2f p95 "
      "%5.2f\n",
      leg, std::sqrt(2 * 2 + 2 * 2 + 3.2 * 3.2) / leg, before.first, before.second, after.first,
      after.second);
}

void print_growth(double largest, const RunContext& context) {
  std::vector<double> x, y;
  for (double triangles = 125e3; triangles <= largest * 1.01; triangles *= 2) {
    const int rings = static_cast<int>(std::sqrt(triangles / 3));
    Mesh m = tube_mesh();
    add_revolution(ball(1, rings, 0.1), {}, static_cast<std::uint32_t>(1.5 * rings), m);
    finish(m);
    const ConditionedMesh mesh = condition_mesh(m, true, {}, context);
    double s = 0;
    timed(mesh, {}, context, s);
    std::printf("%9zu triangles  %6.2f s\n", mesh.mesh.triangles.size(), s);
    std::fflush(stdout);
    x.push_back(static_cast<double>(mesh.mesh.triangles.size()));
    y.push_back(s);
  }
  if (x.size() > 1) std::printf("exponent %.2f\n", growth_exponent(x, y));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Skeleton and R: time, smoothness, what local thickness corrects, growth"};
  std::vector<std::string> models;
  RunContext context;
  double growth = 0;
  bool limbs = false;
  app.add_option("MODEL", models, "models to measure");
  app.add_option("--threads", context.threads, "threads")->capture_default_str();
  app.add_option("--growth", growth, "largest triangle count of the growth series, 0 = none");
  app.add_flag("--limbs", limbs, "a ball with legs of known radius");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!models.empty())
      std::printf("%-28s %9s %7s %7s %6s %8s %8s %7s %8s %8s\n", "model", "triangles", "plain s", "s", "segs",
                  "R before", "R p50", "lower %", "jump % b", "jump %");
    for (const std::string& model : models) print_model(model, context);
    if (limbs)
      for (double leg : {0.3, 0.15, 0.1, 0.06, 0.03}) print_limbs(leg, context);
    if (growth > 0) print_growth(growth, context);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
