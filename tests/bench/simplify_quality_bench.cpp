// How good are coarse meshes, against meshoptimizer chained over the same triangle counts? For every model:
// import, condition, scale space, then the collapses to 50, 10 and 2 % of the vertices. Measured alike for
// both, in the same run:
//   rms    distance between the surfaces, sampled both ways, ours / meshoptimizer's
//   shift  how far the texture coordinate of a point of the original has moved on the coarse surface, 95th
//          percentile over points, in pixels of a 4096 px texture: ours and meshoptimizer's
// "stuck": that side stopped before the count. Folders are searched for models.
#include <meshoptimizer.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/base/parallel.h"
#include "stages/condition/condition.h"
#include "stages/geometry/distance.h"
#include "stages/simplification/collapse_engine.h"
#include "stages/ssf/ssf.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
namespace fs = std::filesystem;

/// A surface with a texture coordinate per corner.
struct Textured {
  std::vector<Vec3f> points;
  std::vector<Vec2f> uv;
  std::vector<Triangle> triangles;  // index both
};

Textured textured(const Mesh& mesh, const CollapseMesh* engine, std::vector<Triangle> triangles) {
  Textured out;
  for (std::size_t w = 0; w < mesh.wedge_count(); ++w) {
    out.points.push_back(mesh.positions[mesh.wedge_position[w]]);
    out.uv.push_back(mesh.uv0.empty() ? Vec2f{} : mesh.uv0[w]);
  }
  if (engine)
    for (const CollapseMesh::NewWedge& w : engine->new_wedges()) {
      out.points.push_back(mesh.positions[w.position]);
      out.uv.push_back(mesh.uv0.empty() ? Vec2f{} : mesh.uv0[w.source]);
    }
  out.triangles = std::move(triangles);
  return out;
}

struct Identity : std::vector<std::uint32_t> {
  explicit Identity(std::size_t n) : std::vector<std::uint32_t>(n) {
    for (std::size_t i = 0; i < n; ++i) (*this)[i] = static_cast<std::uint32_t>(i);
  }
};

Vec3d corner(const Textured& s, std::size_t t, std::size_t k) {
  return to_double(s.points[s.triangles[t][k]]);
}

/// The nearest point of a triangle, as weights of its corners.
Vec3d nearest_weights(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d n = cross(b - a, c - a);
  const double square = dot(n, n);
  if (square > 0) {
    const Vec3d w{dot(cross(b - p, c - p), n) / square, dot(cross(c - p, a - p), n) / square,
                  dot(cross(a - p, b - p), n) / square};
    if (w.x >= 0 && w.y >= 0 && w.z >= 0) return w;
  }
  Vec3d best{1, 0, 0};
  double least = std::numeric_limits<double>::infinity();
  const Vec3d corners[3] = {a, b, c};
  for (int k = 0; k < 3; ++k) {
    const Vec3d s = corners[k], d = corners[(k + 1) % 3] - s;
    const double t = dot(d, d) > 0 ? std::clamp(dot(p - s, d) / dot(d, d), 0.0, 1.0) : 0;
    const double far = length(s + d * t - p);
    if (far >= least) continue;
    least = far;
    best = {};
    best[k] = 1 - t, best[(k + 1) % 3] = t;
  }
  return best;
}

/// Answers where a point's texture coordinate lies on a surface: the best match among the triangles that are
/// as near as the nearest, so that a seam beside the point does not count as a shift.
class TextureShift {
 public:
  TextureShift(const Textured& surface, double diagonal) : surface_(surface), slack_(diagonal * 1e-4) {
    lo_ = Vec3d{1e300, 1e300, 1e300};
    Vec3d hi = lo_ * -1;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        for (int x = 0; x < 3; ++x) {
          lo_[x] = std::min(lo_[x], corner(surface, t, k)[x]);
          hi[x] = std::max(hi[x], corner(surface, t, k)[x]);
        }
    const auto side = static_cast<int>(std::sqrt(static_cast<double>(surface.triangles.size()) / 2));
    cells_ = std::clamp(side, 4, 96);
    cell_ = std::max({hi.x - lo_.x, hi.y - lo_.y, hi.z - lo_.z}) / cells_ * 1.0001 + 1e-30;
    grid_.resize(static_cast<std::size_t>(cells_) * cells_ * cells_);
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
      Vec3d a = corner(surface, t, 0), b = a;
      for (std::size_t k = 1; k < 3; ++k)
        for (int x = 0; x < 3; ++x) {
          a[x] = std::min(a[x], corner(surface, t, k)[x]);
          b[x] = std::max(b[x], corner(surface, t, k)[x]);
        }
      each_cell(a, b, [&](std::size_t cell) { grid_[cell].push_back(t); });
    }
  }

  double operator()(Vec3d p, Vec2d uv, double distance) const {
    const double reach = distance * 1.05 + slack_;
    double best = std::numeric_limits<double>::infinity();
    const Vec3d r{reach, reach, reach};
    each_cell(p - r, p + r, [&](std::size_t cell) {
      for (std::uint32_t t : grid_[cell]) {
        const Vec3d w =
            nearest_weights(p, corner(surface_, t, 0), corner(surface_, t, 1), corner(surface_, t, 2));
        Vec3d q;
        Vec2d there;
        for (int k = 0; k < 3; ++k) {
          q = q + corner(surface_, t, static_cast<std::size_t>(k)) * w[k];
          there = there + to_double(surface_.uv[surface_.triangles[t][static_cast<std::size_t>(k)]]) * w[k];
        }
        if (length(q - p) <= reach) best = std::min(best, std::sqrt(dot(there - uv, there - uv)));
      }
    });
    return best;
  }

 private:
  template <class Body>
  void each_cell(Vec3d a, Vec3d b, Body&& body) const {
    int from[3], to[3];
    for (int x = 0; x < 3; ++x) {
      from[x] = std::clamp(static_cast<int>((a[x] - lo_[x]) / cell_), 0, cells_ - 1);
      to[x] = std::clamp(static_cast<int>((b[x] - lo_[x]) / cell_), 0, cells_ - 1);
    }
    for (int z = from[2]; z <= to[2]; ++z)
      for (int y = from[1]; y <= to[1]; ++y)
        for (int x = from[0]; x <= to[0]; ++x) body((static_cast<std::size_t>(z) * cells_ + y) * cells_ + x);
  }
  const Textured& surface_;
  double slack_, cell_ = 1;
  Vec3d lo_;
  int cells_ = 1;
  std::vector<std::vector<std::uint32_t>> grid_;
};

struct Figures {
  std::size_t triangles = 0;
  double rms = 0, shift_px = 0;
};

class Judge {
 public:
  Judge(const Textured& original, double diagonal, bool uv, std::size_t samples, const RunContext& context)
      : original_(original),
        identity_(original.points.size()),
        surface_(original.points, identity_, original.triangles),
        samples_(sample_surface(original.points, identity_, original.triangles, samples)),
        diagonal_(diagonal),
        uv_(uv),
        context_(context) {}

  Figures judge(const Textured& coarse) const {
    const Identity identity(coarse.points.size());
    const SurfaceDistance surface(coarse.points, identity, coarse.triangles);
    const TextureShift shift(coarse, diagonal_);
    std::vector<double> there(samples_.size()), moved(samples_.size());
    const std::vector<SurfaceSample> back_samples =
        sample_surface(coarse.points, identity, coarse.triangles, samples_.size());
    std::vector<double> back(back_samples.size());
    parallel_for(context_, samples_.size(), 500, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3d p = place(original_, samples_[i]);
        there[i] = surface(p);
        if (uv_) moved[i] = 4096 * shift(p, texture(original_, samples_[i]), there[i]);
      }
    });
    parallel_for(context_, back.size(), 500, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) back[i] = surface_(place(coarse, back_samples[i]));
    });
    Figures f;
    f.triangles = coarse.triangles.size();
    for (const auto* side : {&there, &back})
      for (double d : *side) f.rms += d * d;
    f.rms = std::sqrt(f.rms / static_cast<double>(there.size() + back.size())) / diagonal_;
    const auto p95 = moved.begin() + static_cast<std::ptrdiff_t>(moved.size() * 95 / 100);
    std::nth_element(moved.begin(), p95, moved.end());
    f.shift_px = *p95;
    return f;
  }

 private:
  static Vec3d place(const Textured& s, const texmesh::SurfaceSample& at) {
    Vec3d p;
    for (std::size_t k = 0; k < 3; ++k) p = p + corner(s, at.triangle, k) * at.weight[k];
    return p;
  }
  static Vec2d texture(const Textured& s, const texmesh::SurfaceSample& at) {
    Vec2d p;
    for (std::size_t k = 0; k < 3; ++k)
      p = p + to_double(s.uv[s.triangles[at.triangle][k]]) * double{at.weight[k]};
    return p;
  }
  const Textured& original_;
  Identity identity_;
  SurfaceDistance surface_;
  std::vector<texmesh::SurfaceSample> samples_;
  double diagonal_;
  bool uv_;
  const RunContext& context_;
};

std::vector<unsigned> flat(const std::vector<Triangle>& triangles) {
  std::vector<unsigned> out;
  for (const Triangle& t : triangles) out.insert(out.end(), t.begin(), t.end());
  return out;
}

struct Cell {
  Figures ours, peer;
  bool ours_stuck = false, peer_stuck = false;
};

struct Settings {
  SimplificationOptions simplification;
  std::size_t samples = 30'000;
  bool persistence = true;
};

constexpr double kShares[3] = {0.5, 0.1, 0.02};

std::array<Cell, 3> compare(const Mesh& source, const Settings& settings, const RunContext& context) {
  const ConditionedMesh mesh = condition_mesh(source, false, {}, context);
  ScaleMap map;
  map.scales = 20;
  map.persistence.assign(mesh.mesh.positions.size(), 0);
  if (settings.persistence) map = filter_scale_space(mesh, {}, context);
  SimplificationOptions options = settings.simplification;
  CollapseEngine engine(mesh, map, options, context);
  const Textured original = textured(mesh.mesh, nullptr, mesh.mesh.triangles);
  const Judge judge(original, engine.mesh().diagonal(), !mesh.mesh.uv0.empty(), settings.samples, context);
  std::vector<unsigned> indices = flat(mesh.mesh.triangles);
  std::array<Cell, 3> cells;
  for (std::size_t i = 0; i < 3; ++i) {
    Cell& cell = cells[i];
    const auto positions = static_cast<double>(mesh.mesh.positions.size());
    cell.ours_stuck = engine.run_to(static_cast<std::uint32_t>(positions * kShares[i]), 255, context) !=
                      CollapseStop::kReached;
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> from;
    engine.mesh().snapshot(triangles, from);
    cell.ours = judge.judge(textured(mesh.mesh, &engine.mesh(), triangles));
    const std::size_t target = 3 * triangles.size();
    if (target < indices.size())
      indices.resize(meshopt_simplify(indices.data(), indices.data(), indices.size(), &original.points[0].x,
                                      original.points.size(), sizeof(Vec3f), target, 1e9f, 0, nullptr));
    cell.peer_stuck = indices.size() > target + target / 33;
    std::vector<Triangle> theirs(indices.size() / 3);
    for (std::size_t t = 0; t < theirs.size(); ++t)
      theirs[t] = {indices[3 * t], indices[3 * t + 1], indices[3 * t + 2]};
    cell.peer = judge.judge(textured(mesh.mesh, nullptr, std::move(theirs)));
  }
  return cells;
}

void print(const std::string& name, const std::array<Cell, 3>& cells) {
  std::printf("%-34s", name.substr(0, 34).c_str());
  for (const Cell& c : cells) {
    char triangles[32];
    std::snprintf(triangles, sizeof triangles, "%zu%s/%zu%s", c.ours.triangles, c.ours_stuck ? "!" : "",
                  c.peer.triangles, c.peer_stuck ? "!" : "");
    std::printf(" |%15s %4.2f %6.1f/%-6.1f", triangles, c.ours.rms / c.peer.rms, c.ours.shift_px,
                c.peer.shift_px);
  }
  std::printf("\n");
  std::fflush(stdout);
}

bool is_model(const fs::path& file) {
  const std::string e = file.extension();
  return e == ".glb" || e == ".gltf" || e == ".obj" || e == ".ply";
}

std::vector<fs::path> models_of(const std::vector<std::string>& inputs) {
  std::vector<fs::path> files;
  for (const std::string& input : inputs) {
    if (!fs::is_directory(input)) {
      files.push_back(input);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(input))
      if (entry.is_regular_file() && is_model(entry.path()) &&
          entry.path().string().find("/original/") == std::string::npos)
        files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

Mesh import_mesh(const fs::path& file, const RunContext& context) {
  std::ifstream in(file, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  FileResolver resolver(file.parent_path());
  return import_model(file.filename(), bytes, resolver, {}, context).model.mesh;
}

int run(int argc, char** argv) {
  std::vector<std::string> inputs;
  Settings settings;
  RunContext context;
  CLI::App app("Simplification's quality against meshoptimizer's, model by model.");
  app.add_option("models", inputs, "files, or folders to search")->required();
  app.add_option("--samples", settings.samples, "points per surface")->capture_default_str();
  app.add_option("--threads", context.threads, "threads")->capture_default_str();
  app.add_option("--uv-weight", settings.simplification.uv_weight, "")->capture_default_str();
  app.add_option("--normal-weight", settings.simplification.normal_weight, "")->capture_default_str();
  app.add_option("--seam-weight", settings.simplification.seam_weight, "")->capture_default_str();
  app.add_option("--boundary-weight", settings.simplification.boundary_weight, "")->capture_default_str();
  app.add_option("--persistence-weight", settings.simplification.persistence_weight, "")
      ->capture_default_str();
  app.add_option("--colour-weight", settings.simplification.colour_weight, "")->capture_default_str();
  app.add_option("--max-shift", settings.simplification.max_shift, "")->capture_default_str();
  app.add_option("--max-error", settings.simplification.max_error, "")->capture_default_str();
  app.add_flag("!--no-persistence", settings.persistence, "leave scale space out");
  CLI11_PARSE(app, argc, argv);
  settings.simplification.min_triangles = 1;
  std::printf("%-34s", "model (! = stuck)");
  for (double share : kShares) std::printf(" | %3.0f %%: triangles  rms  shift px 95 %%", 100 * share);
  std::printf("\n");
  int models = 0, rms_met[3] = {}, rms_of[3] = {}, shift_met = 0, shift_of = 0;
  for (const fs::path& file : models_of(inputs)) {
    try {
      const Mesh mesh = import_mesh(file, context);
      const std::array<Cell, 3> cells = compare(mesh, settings, context);
      print(file.parent_path().filename().string() + "/" + file.filename().string(), cells);
      ++models;
      for (std::size_t i = 0; i < 3; ++i) {
        const Cell& c = cells[i];
        if (mesh.uv0.empty() || c.ours_stuck || c.peer_stuck) continue;
        ++rms_of[i], ++shift_of;
        rms_met[i] += c.ours.rms <= (i == 2 ? 1.1 : 1.0) * c.peer.rms;
        shift_met += c.ours.shift_px <= c.peer.shift_px;
      }
    } catch (const std::exception& e) {
      std::printf("%-34s left out: %s\n", file.filename().c_str(), e.what());
    }
  }
  std::printf(
      "of %d models, cells with UVs where neither is stuck: rms ratio <= 1.0 at 50 %%: %d of %d, at 10 "
      "%%: %d of %d; <= 1.1 at 2 %%: %d of %d; texture shift not larger: %d of %d\n",
      models, rms_met[0], rms_of[0], rms_met[1], rms_of[1], rms_met[2], rms_of[2], shift_met, shift_of);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "simplify_quality_bench: " << e.what() << '\n';
    return 1;
  }
}
