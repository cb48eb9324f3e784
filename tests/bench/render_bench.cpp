// What a lit picture costs: render_bench [--size PX] [--views N] [--threads N] [--png FOLDER] [MODEL ...].
// Times are the least of five runs, in ms: environment, mips of all textures, what is seen, its shading.
// Without a model a made one of 100,000 triangles with four maps of 2048 px; "balls" is a grid of metal x
// roughness. With
// --png the pictures are written, too.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>

#include "format/base/portable_math.h"
#include "format/base/vec.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/render/shade.h"
#include "tests/bench/bench_model.h"

namespace texmesh {
namespace {

struct BenchScene {
  std::string name;
  Mesh mesh;
  std::vector<RenderMaterial> materials;
  std::vector<Pixels> images;
  std::vector<bool> srgb;  // per image
};

BenchScene read_scene(const std::string& path, const RunContext& context) {
  FileResolver resolver(std::filesystem::path(path).parent_path());
  ImportedModel m = import_model(std::filesystem::path(path).filename().string(),
                                 read_input_file(path, 1ull << 32), resolver, {}, context);
  BenchScene scene;
  scene.name = model_name(path);
  std::map<std::pair<std::int32_t, bool>, std::int32_t> known;
  for (const Material& material : m.model.materials)
    scene.materials.push_back(render_material(material, [&](const TextureRef& ref, TextureUse use) {
      const auto [at, is_new] =
          known.try_emplace({ref.image, is_srgb(use)}, static_cast<std::int32_t>(scene.images.size()));
      if (is_new) {
        scene.images.push_back(decode_image(m.model.images[static_cast<std::size_t>(ref.image)],
                                            is_srgb(use) ? FloatEncoding::kSrgb : FloatEncoding::kAsIs));
        scene.srgb.push_back(is_srgb(use));
      }
      return at->second;
    }));
  scene.mesh = std::move(m.model.mesh);
  return scene;
}

// A ball of rings x segments quads with waves of that height; one chart with a seam.
Mesh ball(std::uint32_t rings, std::uint32_t segments, double waves) {
  Mesh mesh;
  for (std::uint32_t i = 0; i <= rings; ++i)
    for (std::uint32_t j = 0; j <= segments; ++j) {
      const double v = static_cast<double>(i) / rings, u = static_cast<double>(j) / segments;
      const double polar = portable::kPi * v, turn = 2 * portable::kPi * u;
      const double radius = 1 + waves * portable::sin(9 * polar) * portable::sin(10 * turn);
      const Vec3d d{portable::sin(polar) * portable::sin(turn), portable::cos(polar),
                    portable::sin(polar) * portable::cos(turn)};
      mesh.wedge_position.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(to_float(d * radius));
      mesh.normals.push_back(to_float(d));
      mesh.uv0.push_back({static_cast<float>(u), static_cast<float>(v)});
    }
  for (std::uint32_t i = 0; i < rings; ++i)
    for (std::uint32_t j = 0; j < segments; ++j) {
      const std::uint32_t a = i * (segments + 1) + j, b = a + segments + 1;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({a + 1, b, b + 1});
    }
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  return mesh;
}

Pixels made_image(std::uint32_t side, std::uint32_t channels, std::uint64_t seed, bool normals) {
  Pixels out{side, side, channels, {}};
  out.data.resize(static_cast<std::size_t>(side) * side * channels);
  for (std::size_t i = 0; i < out.data.size(); ++i) {
    seed = seed * 6364136223846793005ull + 1442695040888963407ull;
    const auto noise = static_cast<std::uint32_t>(seed >> 58);
    out.data[i] = static_cast<std::uint8_t>(!normals ? 96 + noise : i % 3 == 2 ? 240 : 96 + noise);
  }
  return out;
}

BenchScene made_scene() {
  BenchScene scene;
  scene.name = "made";
  scene.mesh = ball(200, 250, 0.05);
  RenderMaterial material;
  for (const TextureUse use : {TextureUse::kBaseColour, TextureUse::kNormal, TextureUse::kMetallicRoughness,
                               TextureUse::kEmissive}) {
    material.slot(use).texture = static_cast<std::int32_t>(scene.images.size());
    scene.images.push_back(made_image(2048, 3, 7 + scene.images.size(), use == TextureUse::kNormal));
    scene.srgb.push_back(is_srgb(use));
  }
  material.emissive = {0.1f, 0.1f, 0.1f};
  scene.materials = {material};
  return scene;
}

// Roughness grows to the right, metallic downwards.
BenchScene ball_scene() {
  constexpr int kSide = 6;
  BenchScene scene;
  scene.name = "balls";
  const Mesh one = ball(48, 96, 0);
  for (int i = 0; i < kSide * kSide; ++i) {
    RenderMaterial material;
    material.base_colour = {0.9f, 0.6f, 0.3f, 1};
    material.roughness = static_cast<float>(i % kSide) / (kSide - 1);
    material.metallic = static_cast<float>(i / kSide) / (kSide - 1);
    scene.materials.push_back(material);
    const auto first = static_cast<std::uint32_t>(scene.mesh.positions.size());
    const auto first_wedge = static_cast<std::uint32_t>(scene.mesh.wedge_position.size());
    const Vec3f offset{static_cast<float>(i % kSide) * 2.2f, -static_cast<float>(i / kSide) * 2.2f, 0};
    for (const Vec3f p : one.positions) scene.mesh.positions.push_back(p + offset);
    for (const std::uint32_t p : one.wedge_position) scene.mesh.wedge_position.push_back(p + first);
    scene.mesh.normals.insert(scene.mesh.normals.end(), one.normals.begin(), one.normals.end());
    for (const Triangle& t : one.triangles) {
      scene.mesh.triangles.push_back({t[0] + first_wedge, t[1] + first_wedge, t[2] + first_wedge});
      scene.mesh.triangle_material.push_back(static_cast<std::uint16_t>(i));
    }
  }
  return scene;
}

// Of the processors, so that other work beside it matters less.
double spent_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double least_ms(const std::function<void()>& work) {
  double least = 1e30;
  for (int i = 0; i < 5; ++i) {
    const double start = spent_ms();
    work();
    least = std::min(least, spent_ms() - start);
  }
  return least;
}

struct Settings {
  std::uint32_t side_px = 512;
  int views = 1;
  RunContext context;
  std::string folder;
};

void measure_scene(const BenchScene& scene, const Settings& settings) {
  RenderEnvironment environment;
  const double environment_ms = least_ms([&] { environment = studio_environment(); });
  std::vector<RenderTexture> textures(scene.images.size());
  const double start = spent_ms();
  for (std::size_t i = 0; i < textures.size(); ++i)
    textures[i] = render_texture(scene.images[i], scene.srgb[i], 0, settings.context);
  const double mips_ms = spent_ms() - start;
  const RenderScene rendered = render_scene(scene.mesh, scene.materials, textures.size());
  const BoundingSphere sphere = bounding_sphere(scene.mesh.positions);
  for (int v = 0; v < settings.views; ++v) {
    const RenderCamera camera =
        perspective_camera(camera_of(v, settings.views, sphere.centre, sphere.radius));
    Visibility seen;
    Picture picture;
    const double look_ms =
        least_ms([&] { seen = look(rendered, camera, settings.side_px, settings.context); });
    const double shade_ms =
        least_ms([&] { picture = shade(rendered, seen, textures, environment, settings.context); });
    const auto covered = std::count(picture.covered.begin(), picture.covered.end(), 1);
    fmt::print("{:20} {:9} {:3} {:8} {:9} {:6.0f} {:6.0f} {:6.0f} {:6.0f}\n", scene.name,
               scene.mesh.triangles.size(), v, covered, seen.fragments.size(), environment_ms, mips_ms,
               look_ms, shade_ms);
    if (settings.folder.empty()) continue;
    const std::vector<std::uint8_t> file = write_png(encode_srgb(picture));
    std::ofstream(fmt::format("{}/{}-{}.png", settings.folder, scene.name, v), std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  }
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  Settings settings;
  std::vector<std::string> models;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    const bool has_value = i + 1 < argc;
    if (name == "--size" && has_value)
      settings.side_px = static_cast<std::uint32_t>(std::stoul(argv[++i]));
    else if (name == "--views" && has_value)
      settings.views = std::stoi(argv[++i]);
    else if (name == "--threads" && has_value)
      settings.context.threads = std::stoi(argv[++i]);
    else if (name == "--png" && has_value)
      settings.folder = argv[++i];
    else
      models.push_back(name);
  }
  if (models.empty()) models.push_back("made");
  fmt::print("{:20} {:>9} {:>3} {:>8} {:>9} {:>6} {:>6} {:>6} {:>6}\n", "model", "triangles", "view",
             "pixels", "fragments", "light", "mips", "look", "shade");
  for (const std::string& model : models)
    measure_scene(model == "made"    ? made_scene()
                  : model == "balls" ? ball_scene()
                                     : read_scene(model, settings.context),
                  settings);
}
