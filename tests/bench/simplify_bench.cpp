// How long does it take to simplify a made scan to its coarsest scale, against meshoptimizer chained over the
// same triangle counts, in one run? Ours is the collapse alone (conditioned mesh in, last scale reached),
// with and without attribute quadrics; the measuring of every scale's error is counted apart. CPU seconds,
// the best of --repeat, since other work on the machine does not count in them; wall seconds stand beside.
// The last lines are the exponents of time over triangles.
#include <meshoptimizer.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>

#include "examples/scan_model.h"
#include "stages/condition/condition.h"
#include "stages/simplification/collapse_engine.h"
#include "stages/simplification/simplification.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file

struct Cost {
  double cpu = 1e300, wall = 1e300;
};

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

Cost best_of(int repeats, const std::function<void()>& work) {
  Cost best;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const double cpu = cpu_seconds();
    work();
    best.cpu = std::min(best.cpu, cpu_seconds() - cpu);
    best.wall =
        std::min(best.wall, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

/// As a scan's: of twenty scales each keeps about 0.83 of the one before.
ScaleMap made_scale_map(std::size_t positions) {
  ScaleMap map;
  map.scales = 20;
  std::uint64_t state = 1;
  for (std::size_t p = 0; p < positions; ++p) {
    int i = 0;
    do state = state * 6364136223846793005ull + 1442695040888963407ull;
    while (i < 20 && (state >> 33) % 1000 < 830 && ++i);
    map.persistence.push_back(static_cast<std::uint8_t>(i));
  }
  return map;
}

/// The collapses to every scale's count of vertices; the triangles of each.
NestedScales collapse(const ConditionedMesh& mesh, const ScaleMap& map, const SimplificationOptions& options,
                      const RunContext& context) {
  CollapseEngine engine(mesh, map, options, context);
  NestedScales nested;
  std::vector<NestedScale>& scales = nested.scales;
  scales.resize(1);
  engine.mesh().snapshot(scales[0].triangles, scales[0].triangle_source);
  for (int i = 1; i <= map.scales; ++i) {
    std::uint32_t left = 0;
    for (std::uint8_t p : map.persistence) left += p >= i;
    engine.run_to(left, i, context);
    engine.mesh().snapshot(scales.emplace_back().triangles, scales.back().triangle_source);
    scales.back().collapse_count = engine.collapses().size();
  }
  nested.collapses = engine.collapses();
  return nested;
}

std::size_t meshopt_chain(const Mesh& mesh, const std::vector<Vec3f>& points,
                          const std::vector<NestedScale>& like) {
  std::vector<unsigned> indices;
  for (const Triangle& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  for (std::size_t i = 1; i < like.size(); ++i) {
    const std::size_t target = 3 * like[i].triangles.size();
    if (target < indices.size())
      indices.resize(meshopt_simplify(indices.data(), indices.data(), indices.size(), &points[0].x,
                                      points.size(), sizeof(Vec3f), target, 1e9f, 0, nullptr));
  }
  return indices.size() / 3;
}

struct Row {
  double triangles;
  Cost peer, plain, attributes, error;
  Cost stage() const { return {attributes.cpu + error.cpu, attributes.wall + error.wall}; }
};

Row measure(int triangles, int repeats, int threads) {
  RunContext context;
  context.threads = threads;
  ScanOptions scan;
  scan.triangles = triangles;
  scan.charts = 60;
  const ConditionedMesh mesh = condition_mesh(make_scan_mesh(RockShape(1), scan).mesh, false, {}, context);
  const ScaleMap map = made_scale_map(mesh.mesh.positions.size());
  std::vector<Vec3f> points;
  for (std::uint32_t p : mesh.mesh.wedge_position) points.push_back(mesh.mesh.positions[p]);
  NestedScales nested;
  const std::vector<NestedScale>& scales = nested.scales;
  Row row;
  row.triangles = static_cast<double>(mesh.mesh.triangles.size());
  SimplificationOptions plain;
  plain.uv_weight = plain.normal_weight = plain.colour_weight = 0;
  row.plain = best_of(repeats, [&] { nested = collapse(mesh, map, plain, context); });
  row.attributes = best_of(repeats, [&] { nested = collapse(mesh, map, {}, context); });
  std::size_t left = 0;
  row.peer = best_of(repeats, [&] { left = meshopt_chain(mesh.mesh, points, scales); });
  // Relaxed junctions' wedges are left out: their faces keep the count, not the place.
  nested.mesh = mesh.mesh;
  for (NestedScale& s : nested.scales)
    std::erase_if(s.triangles, [&](const Triangle& t) {
      return std::max({t[0], t[1], t[2]}) >= nested.mesh.wedge_count();
    });
  row.error = best_of(repeats, [&] { measure_scale_errors(mesh.component, nested, context); });
  std::printf("%9.0f %8zu %8zu | %6.2f %6.2f | %6.2f %6.2f %5.2f | %6.2f %6.2f %5.2f | %6.2f %6.2f\n",
              row.triangles, scales.back().triangles.size(), left, row.peer.cpu, row.peer.wall, row.plain.cpu,
              row.plain.wall, row.plain.cpu / row.peer.cpu, row.attributes.cpu, row.attributes.wall,
              row.attributes.cpu / row.peer.cpu, row.error.cpu, row.error.wall);
  std::fflush(stdout);
  return row;
}

/// Slope of a straight line through log time over log triangles.
template <class CostOf>
double exponent(const std::vector<Row>& rows, CostOf cost) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(rows.size());
  for (const Row& r : rows) {
    const double a = std::log(r.triangles), b = std::log(std::invoke(cost, r).cpu);
    x += a, y += b, xx += a * a, xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

int run(int argc, char** argv) {
  std::vector<int> sizes{125'000, 250'000, 500'000, 1'000'000, 2'000'000};
  int repeats = 1, threads = 2;
  CLI::App app("Simplification's time against meshoptimizer's, over sizes.");
  app.add_option("sizes", sizes, "triangles of the made scans");
  app.add_option("--repeat", repeats, "the best of so many")->check(CLI::Range(1, 100));
  app.add_option("--threads", threads, "of ours; meshoptimizer has one")->check(CLI::Range(1, 256));
  CLI11_PARSE(app, argc, argv);
  std::printf(
      "                   meshopt | meshopt       | without attributes   | with attributes      | errors\n"
      "triangles  coarsest  stops  |   cpu   wall |    cpu   wall ratio  |    cpu   wall ratio  |    cpu   "
      "wall\n");
  std::vector<Row> rows;
  for (int triangles : sizes) rows.push_back(measure(triangles, repeats, threads));
  if (rows.size() > 1)
    std::printf(
        "exponent of CPU time: the stage (attributes and errors) %.2f; collapse without attributes %.2f, "
        "with "
        "%.2f, errors %.2f, meshopt %.2f\n",
        exponent(rows, &Row::stage), exponent(rows, &Row::plain), exponent(rows, &Row::attributes),
        exponent(rows, &Row::error), exponent(rows, &Row::peer));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "simplify_bench: " << e.what() << '\n';
    return 1;
  }
}
