// How do coarse meshes look, beside those that another tool makes with as many triangles?
//   lit_simplify_bench MODEL PEER.glb ... [--package MODEL.texmesh]
// Every PEER is a mesh of MODEL (tests/bench/simplify_peers makes them with gltfpack). Ours has as many
// triangles: from simplification in this process, or with --package the scale whose number is nearest. All
// are shown with MODEL's own textures by the reference renderer, from the same cameras. Printed for each:
// triangles, mean FLIP against MODEL over the pixels that either covers, ours and theirs, and the ratio; with
// --package FLIP and ratio a second time, with the package's textures at their highest rung. The last line
// has the geometric mean and the worst of the ratios.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>

#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "stages/condition/condition.h"
#include "stages/geometry/scale_frames.h"
#include "stages/image/png_writer.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"
#include "stages/simplification/collapse_engine.h"
#include "stages/ssf/ssf.h"
#include "tests/bench/bench_model.h"
#include "tools/extract/package_model.h"
#include "tools/render/rendered_model.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file

struct Settings {
  std::string model, package, png;
  std::vector<std::string> peers;
  int views = 8, size_px = 512;
  SimplificationOptions simplification;
};

ImportedModel import_file(const std::string& path, const RunContext& context) {
  FileResolver resolver(std::filesystem::path(path).parent_path());
  return import_model(std::filesystem::path(path).filename().string(), read_input_file(path, 1ull << 32),
                      resolver, {}, context);
}

/// Pictures of the model, and what shows other meshes with its textures beside them.
class Judge {
 public:
  Judge(ImportedModel imported, const Settings& settings, const RunContext& context)
      : settings_(settings), context_(context), light_(studio_environment()) {
    for (std::size_t m = 0; m < imported.model.materials.size(); ++m)
      material_of_.try_emplace(imported.model.materials[m].name, static_cast<std::uint16_t>(m));
    source_ = rendered_model(std::move(imported), context);
    for (int k = 0; k < settings.views; ++k) {
      cameras_.push_back(
          perspective_camera(camera_of(k, settings.views, source_.bounds.centre, source_.bounds.radius)));
      const Picture picture = picture_of(source_.scene(), source_.textures, {}, k);
      write_png("source", k, picture);
      references_.push_back(prepare_flip(picture));
    }
  }
  const RenderedModel& source() const { return source_; }

  /// With textures and materials of its own.
  double flip(const RenderedModel& model, const std::string& name) const {
    return flip(model.scene(), model.textures, name);
  }
  /// With the source's.
  double flip(const Mesh& mesh, const std::string& name) const {
    return flip(render_scene(mesh, source_.materials, source_.textures.size()), source_.textures, name);
  }
  /// Triangles of other files count other materials: the name tells.
  void count_materials_alike(Mesh& mesh, const std::vector<Material>& materials) const {
    for (std::uint16_t& m : mesh.triangle_material) {
      const auto found = material_of_.find(materials.at(m).name);
      m = found == material_of_.end() ? std::uint16_t{0} : found->second;
    }
  }

 private:
  double flip(const RenderScene& scene, const std::vector<RenderTexture>& textures,
              const std::string& name) const {
    double sum = 0;
    for (int k = 0; k < settings_.views; ++k) {
      const Picture picture = picture_of(scene, textures, scene.mesh->origin - source_.mesh.origin, k);
      write_png(name, k, picture);
      sum += flip_of(references_[static_cast<std::size_t>(k)], prepare_flip(picture));
    }
    return sum / settings_.views;
  }
  Picture picture_of(const RenderScene& scene, const std::vector<RenderTexture>& textures, Vec3d moved,
                     int view) const {
    RenderCamera camera = cameras_[static_cast<std::size_t>(view)];
    camera.eye = camera.eye - moved;
    return shade(scene, look(scene, camera, static_cast<std::uint32_t>(settings_.size_px), context_),
                 textures, light_, context_);
  }
  void write_png(const std::string& name, int view, const Picture& picture) const {
    if (settings_.png.empty()) return;
    const Pixels p = encode_srgb(picture);
    write_file_atomically(fmt::format("{}-{}-{}.png", settings_.png, name, view), texmesh::write_png(p));
  }
  const Settings& settings_;
  const RunContext& context_;
  RenderEnvironment light_;
  RenderedModel source_;
  std::map<std::string, std::uint16_t> material_of_;
  std::vector<RenderCamera> cameras_;
  std::vector<FlipPicture> references_;
};

struct Peer {
  std::string name;
  Mesh mesh;
};

/// The engine's mesh as it is now, lit as a package lights it.
Mesh mesh_of(CollapseEngine& engine, const ConditionedMesh& input, const RunContext& context) {
  NestedScales nest;
  nest.mesh = input.mesh;
  nest.twin = input.twin;
  nest.collapses = engine.collapses();
  nest.scales.resize(2);
  nest.scales[0].triangles = input.mesh.triangles;
  NestedScale& scale = nest.scales[1];
  scale.collapse_count = static_cast<std::uint32_t>(nest.collapses.size());
  engine.mesh().snapshot(scale.triangles, scale.triangle_source);
  Mesh& m = nest.mesh;
  for (const CollapseMesh::NewWedge& w : engine.mesh().new_wedges()) {
    m.wedge_position.push_back(w.position);
    const auto repeat = [&w](auto& values) {
      if (values.empty()) return;
      const auto value = values[w.source];
      values.push_back(value);
    };
    repeat(m.uv0), repeat(m.uv1), repeat(m.normals), repeat(m.colours), repeat(m.tangents);
  }
  return lit_scale(nest, 1, context);
}

void run_to_triangles(CollapseEngine& engine, std::size_t triangles, const RunContext& context) {
  for (int i = 0; i < 40 && engine.mesh().alive_faces() > triangles; ++i) {
    const std::uint32_t surplus = (engine.mesh().alive_faces() - static_cast<std::uint32_t>(triangles)) / 2;
    if (engine.run_to(engine.mesh().alive_positions() - std::max(surplus, 1u), 255, context) !=
        CollapseStop::kReached)
      return;
  }
}

/// Ours with this process's options, peer by peer, finest first.
class InProcess {
 public:
  InProcess(const ImportedModel& imported, const SimplificationOptions& options, const RunContext& context)
      : context_(context),
        mesh_(condition_mesh(imported.model.mesh, imported.normals_by_specification, {}, context)),
        engine_(mesh_, scale_map(options), options, context) {}
  Mesh with_triangles(std::size_t triangles) {
    run_to_triangles(engine_, triangles, context_);
    return mesh_of(engine_, mesh_, context_);
  }

 private:
  ScaleMap scale_map(const SimplificationOptions& options) const {
    if (options.persistence_weight > 0) return filter_scale_space(mesh_, {}, context_);
    ScaleMap map;
    map.persistence.assign(mesh_.mesh.positions.size(), 0);
    return map;
  }
  const RunContext& context_;
  ConditionedMesh mesh_;
  CollapseEngine engine_;
};

int nearest_scale(const Manifest& manifest, std::size_t triangles) {
  const auto far = [&](const ManifestScale& s) {
    return std::fabs(std::log(static_cast<double>(s.triangles) / static_cast<double>(triangles)));
  };
  return std::min_element(manifest.scales.begin(), manifest.scales.end(),
                          [&](const ManifestScale& a, const ManifestScale& b) { return far(a) < far(b); })
      ->scale;
}

/// The ratios of one column.
struct Ratios {
  double logs = 0, worst = 0;
  int count = 0;
  void add(double ratio) {
    logs += std::log(ratio), worst = std::max(worst, ratio);
    ++count;
  }
  std::string text() const {
    return fmt::format("mean {:.3f}, worst {:.3f}", std::exp(logs / std::max(count, 1)), worst);
  }
};

std::vector<Peer> read_peers(const Settings& settings, const Judge& judge, const RunContext& context) {
  std::vector<Peer> peers;
  for (const std::string& file : settings.peers) {
    Model model = std::move(import_file(file, context).model);
    judge.count_materials_alike(model.mesh, model.materials);
    peers.push_back({model_name(file), std::move(model.mesh)});
  }
  std::sort(peers.begin(), peers.end(),
            [](const Peer& a, const Peer& b) { return a.mesh.triangles.size() > b.mesh.triangles.size(); });
  return peers;
}

void compare_in_process(const Settings& settings, const RunContext& context) {
  ImportedModel imported = import_file(settings.model, context);
  InProcess ours(imported, settings.simplification, context);
  const Judge judge(std::move(imported), settings, context);
  Ratios ratios;
  for (const Peer& peer : read_peers(settings, judge, context)) {
    const Mesh mesh = ours.with_triangles(peer.mesh.triangles.size());
    const double a = judge.flip(mesh, "ours-" + peer.name), b = judge.flip(peer.mesh, "peer-" + peer.name);
    fmt::print("{:12} {:8} {:8}  {:.4f} {:.4f}  {:.3f}\n", model_name(settings.model).substr(0, 12),
               mesh.triangles.size(), peer.mesh.triangles.size(), a, b, a / b);
    std::fflush(stdout);
    ratios.add(a / b);
  }
  fmt::print("{}\n", ratios.text());
}

void compare_package(const Settings& settings, const RunContext& context) {
  const Judge judge(import_file(settings.model, context), settings, context);
  PackageReader package(open_store(settings.package));
  Ratios shape, rung;
  for (const Peer& peer : read_peers(settings, judge, context)) {
    PackageChoice choice;
    choice.scale = nearest_scale(package.manifest(), peer.mesh.triangles.size());
    const RenderedModel ours = package_model(package, choice, context);
    const double a = judge.flip(ours.mesh, "ours-" + peer.name),
                 b = judge.flip(peer.mesh, "peer-" + peer.name), c = judge.flip(ours, "rung-" + peer.name);
    fmt::print("{:12} S_{:<2} {:8} {:8}  {:.4f} {:.4f}  {:.3f}  {:.4f}  {:.3f}\n",
               model_name(settings.model).substr(0, 12), choice.scale, ours.mesh.triangles.size(),
               peer.mesh.triangles.size(), a, b, a / b, c, c / b);
    std::fflush(stdout);
    shape.add(a / b);
    rung.add(c / b);
  }
  fmt::print("{}; at the highest rung {}\n", shape.text(), rung.text());
}

int run(int argc, char** argv) {
  Settings settings;
  RunContext context;
  CLI::App app("Coarse meshes as they look, against another tool's.");
  app.add_option("model", settings.model, "")->required();
  app.add_option("peers", settings.peers, "")->required();
  app.add_option("--package", settings.package, "");
  app.add_option("--png", settings.png, "writes the pictures, too: beginning of their names");
  app.add_option("--views", settings.views, "")->capture_default_str();
  app.add_option("--size", settings.size_px, "px")->capture_default_str();
  app.add_option("--threads", context.threads, "")->capture_default_str();
  SimplificationOptions& o = settings.simplification;
  app.add_option("--uv-weight", o.uv_weight, "")->capture_default_str();
  app.add_option("--normal-weight", o.normal_weight, "")->capture_default_str();
  app.add_option("--seam-weight", o.seam_weight, "")->capture_default_str();
  app.add_option("--boundary-weight", o.boundary_weight, "")->capture_default_str();
  app.add_option("--persistence-weight", o.persistence_weight, "")->capture_default_str();
  app.add_option("--colour-weight", o.colour_weight, "")->capture_default_str();
  app.add_option("--max-shift", o.max_shift, "")->capture_default_str();
  app.add_option("--max-error", o.max_error, "")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  o.min_triangles = 1;
  if (settings.package.empty())
    compare_in_process(settings, context);
  else
    compare_package(settings, context);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "lit_simplify_bench: " << e.what() << '\n';
    return 1;
  }
}
