// Scale-space filtering of meshes: speed, growth, memory and accuracy, all in one run.
//   ssf_bench                       made scans of 125k .. 2M triangles: seconds and peak bytes of the stage,
//                                   the exponent of the log-log fit; the machine's STREAM triad against what
//                                   the Chebyshev recurrence moves at 1M vertices
//   ssf_bench --accuracy [MODEL..]  the response on the pyramid against one level in double precision, by
//                                   scale; without models a made scan of --triangles
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
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/base/parallel.h"
#include "stages/condition/condition.h"
#include "stages/ssf/heat_kernel.h"
#include "stages/ssf/ssf.h"
#include "stages/ssf/ssf_component.h"
#include "tests/bench/growth.h"
#include "tests/support/pyramid_accuracy.h"

namespace {

// The fewest bytes that one term of the single-precision recurrence moves: the operator and the vectors, of
// four floats a row, once each.
double heat_term_bytes(const texmesh::HeatOperator& l) {
  const double rows = static_cast<double>(l.vertex_count()), entries = static_cast<double>(l.column.size());
  return rows * (sizeof(std::uint32_t) + 16 * sizeof(float)) +
         entries * (sizeof(std::uint32_t) + sizeof(float));
}

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
  ScanOptions options;
  options.triangles = triangles;
  const ScanMesh scan = make_scan_mesh(RockShape(1), options);
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
    wall.push_back(seconds() - start);
    cpu.push_back(processor_seconds() - start_cpu);
    x.push_back(static_cast<double>(mesh.mesh.triangles.size()));
    std::printf("%10zu %10zu %9.2f %9.2f %9.0f ", mesh.mesh.triangles.size(), mesh.mesh.positions.size(),
                wall.back(), cpu.back(), 1e-6 * static_cast<double>(peak_bytes - before));
    for (int i : {1, 5, 10, 15, 20})
      std::printf(" %td", std::count_if(map.persistence.begin(), map.persistence.end(),
                                        [&](int p) { return p >= i; }));
    std::printf("\n");
    std::fflush(stdout);
  }
  if (x.size() > 1)
    std::printf("time exponent: wall %.2f, cpu %.2f\n", growth_exponent(x, wall), growth_exponent(x, cpu));
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

void print_accuracy(const std::string& name, const ConditionedMesh& mesh, const SsfOptions& options,
                    const RunContext& context) {
  const SurfaceComponent c = largest_surface(mesh);
  std::printf("%s: %zu vertices\n%5s %9s | %8s %8s | %9s %6s %8s %8s %12s\n", name.c_str(), c.points.size(),
              "scale", "sigma", "single %", "flips %", "pyramid", "bound", "error %", "flips %",
              "significant %");
  const std::vector<testing::ScaleAccuracy> scales = testing::measure_pyramid(c, options, context);
  for (std::size_t i = 0; i < scales.size(); ++i) {
    const testing::ScaleAccuracy& s = scales[i];
    std::printf("  S%-2zu %9.2f | %8.4f %8.4f | %9zu %6.0f %8.3f %8.3f %12.3f\n", i + 1, s.sigma,
                100 * s.single.error, 100 * s.single.flips, s.vertices, s.bound, 100 * s.pyramid.error,
                100 * s.pyramid.flips, 100 * s.pyramid.significant);
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
