// Scale-space filtering of meshes: speed, growth, memory and accuracy, all in one run.
//   ssf_bench                      made scans of 125k .. 2M triangles: seconds and peak bytes of the stage,
//   and
//                                  the exponent of the log-log fit; the machine's STREAM triad against what
//                                  the Chebyshev recurrence moves at 1M vertices
//   ssf_bench --accuracy [MODEL..] the response on the pyramid against one level in double precision, scale
//   by
//                                  scale; without models a made scan of --triangles
#include <malloc.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "examples/scan_model.h"
#include "pipeline/file_resolver.h"
#include "pipeline/import/import.h"
#include "stages/condition.h"
#include "stages/heat_levels.h"
#include "stages/parallel.h"
#include "stages/ssf.h"
#include "stages/ssf_component.h"

namespace {

// Every allocation of the process is counted: what the stage asks for, not what the system keeps mapped.
std::atomic<std::size_t> live_bytes{0}, peak_bytes{0};

void count_allocation(void* p) {
  if (!p) throw std::bad_alloc();
  const std::size_t now = live_bytes += malloc_usable_size(p);
  std::size_t peak = peak_bytes;
  while (now > peak && !peak_bytes.compare_exchange_weak(peak, now)) {
  }
}

void release(void* p) {
  if (p) live_bytes -= malloc_usable_size(p);
  std::free(p);
}

}  // namespace

void* operator new(std::size_t size) {
  void* p = std::malloc(size);
  count_allocation(p);
  return p;
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto align = static_cast<std::size_t>(alignment);
  void* p = std::aligned_alloc(align, (size + align - 1) / align * align);
  count_allocation(p);
  return p;
}
void operator delete(void* p) noexcept { release(p); }
void operator delete(void* p, std::size_t) noexcept { release(p); }
void operator delete(void* p, std::align_val_t) noexcept { release(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { release(p); }

namespace texmesh {
namespace {

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Processor seconds of all threads: what a busy machine leaves untouched.
double processor_seconds() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  return static_cast<double>(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
}

ConditionedMesh made_scan(int triangles, const RunContext& context) {
  examples::ScanOptions options;
  options.triangles = triangles;
  const examples::ScanMesh scan = make_scan_mesh(examples::ScanShape(1), options);
  return condition_mesh(scan.mesh, true, {}, context);
}

/// STREAM triad a = b + s c over arrays far larger than a core's caches; best of ten, GB/s.
double stream_triad(const RunContext& context) {
  constexpr std::size_t kCount = std::size_t{24} << 20;
  std::vector<double> a(kCount, 0), b(kCount, 1), c(kCount, 2);
  double best = 1e30;
  for (int run = 0; run < 10; ++run) {
    const double start = seconds();
    parallel_for(context, kCount, kCount / static_cast<std::size_t>(context.threads),
                 [&](std::size_t begin, std::size_t end) {
                   double* to = a.data();
                   const double *x = b.data(), *y = c.data();
                   for (std::size_t i = begin; i < end; ++i) to[i] = x[i] + 3 * y[i];
                 });
    best = std::min(best, seconds() - start);
  }
  return 24e-9 * static_cast<double>(kCount) / best;
}

/// Best of three runs of 200 terms for one time: its accumulation is counted as time, not as bytes.
double recurrence(const HeatLevel& level, const RunContext& context) {
  double time = 1;
  while (heat_terms(time, level.laplacian.bound) < 200) time *= 1.1;
  const int terms = heat_terms(time, level.laplacian.bound);
  double best = 1e30;
  for (int run = 0; run < 3; ++run) {
    const std::vector<double> one{time * 1e-6, time};
    const std::vector<double> times{time};
    const double start = seconds();
    diffuse(level.laplacian, level.points, 0, std::span(one).first(1), context);
    const double overhead = seconds() - start;
    diffuse(level.laplacian, level.points, 0, times, context);
    best = std::min(best, seconds() - start - 2 * overhead);
  }
  return 1e-9 * heat_term_bytes(level.laplacian) * terms / best;
}

void print_growth(const std::vector<int>& sizes, const RunContext& context) {
  std::printf("%10s %10s %9s %9s %9s  %s\n", "triangles", "positions", "wall s", "cpu s", "peak MB",
              "S1..S20 features");
  std::vector<double> x, wall, cpu;
  for (int triangles : sizes) {
    const ConditionedMesh mesh = made_scan(triangles, context);
    peak_bytes = live_bytes.load();
    const std::size_t before = live_bytes;
    const double start = seconds(), start_cpu = processor_seconds();
    const ScaleMap map = filter_scale_space(mesh, {}, context);
    wall.push_back(std::log(seconds() - start));
    cpu.push_back(std::log(processor_seconds() - start_cpu));
    x.push_back(std::log(static_cast<double>(mesh.mesh.triangles.size())));
    std::printf("%10zu %10zu %9.2f %9.2f %9.0f ", mesh.mesh.triangles.size(), mesh.mesh.positions.size(),
                std::exp(wall.back()), std::exp(cpu.back()), 1e-6 * static_cast<double>(peak_bytes - before));
    for (int i : {1, 5, 10, 15, 20})
      std::printf(" %td", std::count_if(map.persistence.begin(), map.persistence.end(),
                                        [&](int p) { return p >= i; }));
    std::printf("\n");
    std::fflush(stdout);
  }
  const auto slope = [&](const std::vector<double>& y) {
    double mx = 0, my = 0, top = 0, bottom = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      mx += x[i] / static_cast<double>(x.size());
      my += y[i] / static_cast<double>(x.size());
    }
    for (std::size_t i = 0; i < x.size(); ++i) {
      top += (x[i] - mx) * (y[i] - my);
      bottom += (x[i] - mx) * (x[i] - mx);
    }
    return top / bottom;
  };
  if (x.size() > 1) std::printf("time exponent: wall %.2f, cpu %.2f\n", slope(wall), slope(cpu));
}

void print_bandwidth(int triangles, const RunContext& context) {
  const ConditionedMesh mesh = made_scan(triangles, context);
  SurfaceComponent c = largest_surface(mesh);
  const HeatLevel level = finest_level(std::move(c.points), std::move(c.corners), 1, SsfOptions{}.rate_cap);
  const double triad = stream_triad(context), moved = recurrence(level, context);
  std::printf(
      "%zu vertices, %d threads: triad %.1f GB/s, recurrence %.1f GB/s, share %.2f (capped %.2f %%, bound "
      "%.0f)\n",
      level.points.size(), context.threads, triad, moved, moved / triad, 100 * level.laplacian.capped,
      level.laplacian.bound);
}

struct Difference {
  double error = 0, flips = 0, significant = 0;
};

/// Of `flow` at some vertices against the truth there: relative error, and the share of components of the
/// response that have the wrong sign, all of them and those above a tenth of the rms.
std::vector<Vec3d> normals(const SurfaceComponent& c, const HeatFlow& truth) {
  std::vector<Vec3d> n(c.points.size());
  const auto at = [&](std::uint32_t v) { return c.points[v] + to_double(truth.moved[v]); };
  for (std::size_t h = 0; h < c.corners.size(); h += 3) {
    const Vec3d a = at(c.corners[h]), m = cross(at(c.corners[h + 1]) - a, at(c.corners[h + 2]) - a);
    for (std::size_t k = 0; k < 3; ++k) n[c.corners[h + k]] = n[c.corners[h + k]] + m;
  }
  for (Vec3d& v : n) v = normalized(v);
  return n;
}

Difference compare_n(const std::vector<Vec3d>& n, const HeatFlow& flow, const HeatFlow& truth,
                     const std::vector<std::uint32_t>& vertex) {
  double difference = 0, size = 0, tangential = 0;
  for (std::size_t v = 0; v < vertex.size(); ++v) {
    const Vec3d t = to_double(truth.response[vertex[v]]);
    const double a = dot(to_double(flow.response[v]), n[vertex[v]]), b = dot(t, n[vertex[v]]);
    difference += (a - b) * (a - b);
    size += b * b;
    tangential += dot(t, t) - b * b;
  }
  Difference out;
  const double count = static_cast<double>(vertex.size()), limit = 0.1 * std::sqrt(size / count);
  for (std::size_t v = 0; v < vertex.size(); ++v) {
    const double a = dot(to_double(flow.response[v]), n[vertex[v]]),
                 b = dot(to_double(truth.response[vertex[v]]), n[vertex[v]]);
    const bool flip = (a < 0) != (b < 0);
    out.significant += (flip && std::fabs(b) > limit) / count;
  }
  out.error = std::sqrt(difference / size);
  out.flips = std::sqrt(tangential / size);
  return out;
}

Difference compare(const HeatFlow& flow, const HeatFlow& truth, const std::vector<std::uint32_t>& vertex) {
  double difference = 0, size = 0;
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      difference += (a - b) * (a - b);
      size += b * b;
    }
  Difference out;
  const double count = 3 * static_cast<double>(vertex.size()), limit = 0.1 * std::sqrt(size / count);
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      const bool flip = (a < 0) != (b < 0);
      out.flips += flip / count;
      out.significant += (flip && std::fabs(b) > limit) / count;
    }
  out.error = std::sqrt(difference / size);
  return out;
}

void print_accuracy(const std::string& name, const ConditionedMesh& mesh, const SsfOptions& options,
                    const RunContext& context) {
  SurfaceComponent c = largest_surface(mesh);
  const SigmaLadder ladder = make_sigma_ladder(options.sigma_max * c.diagonal / c.mean_edge, options);
  const std::span<const double> times(ladder.time.data(), static_cast<std::size_t>(options.scales));
  HeatLevel level = finest_level(c.points, c.corners, 1, options.rate_cap);
  std::printf("%s: %zu vertices, %.1f %% of edges capped, bound %.0f\n", name.c_str(), c.points.size(),
              100 * level.laplacian.capped, level.laplacian.bound);
  double start = seconds();
  const auto truth = diffuse(level.laplacian, c.points, 0, times, context, HeatPrecision::kDouble);
  std::printf("  double %.1f s, ", seconds() - start);
  start = seconds();
  const auto single = diffuse(level.laplacian, c.points, 0, times, context);
  std::printf("single %.1f s\n", seconds() - start);
  std::vector<std::uint32_t> vertex = level.vertex;
  const std::vector<std::uint32_t> all = vertex;
  std::vector<std::vector<Vec3d>> states{c.points};
  std::vector<double> state_times{0};
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!carries(level, ladder.sigma[i], options.error_ratio) && i > 0) {
      HeatLevel coarse = coarsen(level, seed_radius(ladder.sigma[i], options.error_ratio), options.rate_cap);
      std::size_t s = states.size() - 1;
      const double wanted = handover_sigma(ladder.sigma[i]);
      while (s > 0 && state_times[s - 1] > 0 && std::sqrt(2 * state_times[s]) > wanted) --s;
      std::vector<Vec3d> points;
      for (std::size_t v = 0; v < coarse.vertex.size(); ++v) {
        vertex[v] = vertex[coarse.vertex[v]];
        points.push_back(states[s][coarse.vertex[v]]);
      }
      vertex.resize(coarse.vertex.size());
      states = {std::move(points)};
      state_times = {state_times[s]};
      level = std::move(coarse);
    }
    const std::vector<HeatFlow> flow =
        diffuse(level.laplacian, states.back(), state_times.back(), times.subspan(i, 1), context);
    const Difference one = compare(single[i], truth[i], all), pyramid = compare(flow[0], truth[i], vertex);
    std::printf(
        "  S%-2zu sigma %6.2f  single: error %.4f %% flips %.4f %%   pyramid: %8zu vertices, bound %5.0f, "
        "error %6.3f %% "
        "flips %.3f %% significant %.3f %%\n",
        i + 1, ladder.sigma[i], 100 * one.error, 100 * one.flips, vertex.size(),
        level.laplacian.bound * level.spacing * level.spacing, 100 * pyramid.error, 100 * pyramid.flips,
        100 * pyramid.significant);
    const Difference nn = compare_n(normals(c, truth[i]), flow[0], truth[i], vertex);
    std::printf("     normal part: error %6.3f %%  significant flips %.3f %%   tangential/normal %.3f\n",
                100 * nn.error, 100 * nn.significant, nn.flips);
    states.push_back(states.back());
    for (std::size_t v = 0; v < vertex.size(); ++v)
      states.back()[v] = states.back()[v] + to_double(flow[0].moved[v]);
    state_times.push_back(times[i]);
  }
}

ConditionedMesh load(const std::filesystem::path& path, const RunContext& context) {
  FileResolver files(path.parent_path());
  const std::string name = path.filename().string();
  const auto bytes = files.read(name, std::uint64_t{1} << 40);
  if (!bytes) throw InputError(name, "", "a file", "none");
  const ImportedModel imported = import_model(name, *bytes, files, {}, context);
  return condition_mesh(imported.model.mesh, true, {}, context);
}

int run(int argc, char** argv) {
  CLI::App app{"Scale-space filtering: speed, growth, memory, accuracy"};
  std::vector<std::string> models;
  std::vector<int> sizes{125'000, 250'000, 500'000, 1'000'000, 2'000'000};
  bool accuracy = false;
  int triangles = 2'000'000;
  RunContext context;
  context.threads = 2;
  SsfOptions options;
  app.add_flag("--accuracy", accuracy, "pyramid and single precision against one level in double");
  app.add_option("models", models, "scans to take instead of made ones");
  app.add_option("--sizes", sizes, "triangles of the growth table")->delimiter(',');
  app.add_option("--triangles", triangles, "of the made scan for bandwidth and accuracy");
  app.add_option("--threads", context.threads, "");
  app.add_option("--error-ratio", options.error_ratio, "");
  app.add_option("--rate-cap", options.rate_cap, "");
  CLI11_PARSE(app, argc, argv);
  if (!accuracy) {
    print_bandwidth(triangles, context);
    print_growth(sizes, context);
  } else if (models.empty()) {
    print_accuracy("made scan", made_scan(triangles, context), options, context);
  }
  for (const std::string& model : models) print_accuracy(model, load(model, context), options, context);
  return 0;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) { return texmesh::run(argc, argv); }
