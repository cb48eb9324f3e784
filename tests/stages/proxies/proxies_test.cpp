#include "stages/proxies/proxies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "stages/base/run_context.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/meshes.h"

namespace texmesh::proxies_test {

NestedScales only_scale(Mesh mesh) {
  NestedScales out;
  NestedScale s;
  s.triangles = mesh.triangles;
  for (std::uint32_t t = 0; t < s.triangles.size(); ++t) s.triangle_source.push_back(t);
  out.mesh = std::move(mesh);
  out.scales.push_back(std::move(s));
  return out;
}

struct ProxyModel {
  Mesh mesh;
  std::vector<Material> materials{Material{}};
  Fragments fragments;
  std::vector<Pixels> pixels;
  std::vector<Image> images;  // what they take in the source
};

void add_plane(ProxyModel& model, TextureRole role, std::uint32_t side_px, auto&& value) {
  TexturePlane plane;
  plane.role = role;
  plane.width_px = plane.height_px = side_px;
  plane.channels = role == TextureRole::kAlpha ? 1 : 3;
  plane.columns = plane.rows = 1;
  plane.fragment_width_px = plane.fragment_height_px = side_px;
  Pixels p{side_px, side_px, plane.channels, {}};
  for (std::uint32_t y = 0; y < side_px; ++y)
    for (std::uint32_t x = 0; x < side_px; ++x)
      for (std::uint32_t c = 0; c < plane.channels; ++c)
        p.data.push_back(static_cast<std::uint8_t>(value(x, y, c)));
  model.fragments.planes.push_back(std::move(plane));
  model.pixels.push_back(std::move(p));
  if (role == TextureRole::kAlpha) return;
  Image& image = model.images.emplace_back();
  image.width_px = image.height_px = side_px;
}

ProxyModel textured(Mesh mesh) {
  ProxyModel out{std::move(mesh), {Material{}}, {}, {}, {}};
  out.materials[0].metallic = 0;
  out.materials[0].base_colour_texture.image = 0;
  add_plane(out, TextureRole::kBaseColour, 256, [](auto x, auto y, auto c) {
    return c == 0 ? x : c == 1 ? y : 128;
  });
  return out;
}

/// A texture that takes all bytes that it can get.
ProxyModel noisy(Mesh mesh) {
  ProxyModel out = textured(std::move(mesh));
  std::uint32_t state = 1;
  for (std::uint8_t& code : out.pixels[0].data)
    code = static_cast<std::uint8_t>((state = state * 1664525u + 1013904223u) >> 24);
  return out;
}

Proxies proxies_of(const ProxyModel& model, const ProxiesOptions& options = {ProxyMode::kAlways, {20000}},
                   int threads = 1) {
  RunContext context;
  context.threads = threads;
  return make_proxies(only_scale(model.mesh), model.materials, model.images, model.fragments, model.pixels,
                      options, context);
}

void expect_sound(const Proxies& made, const std::string& what) {
  EXPECT_FALSE(made.proxies.empty() && made.notes.empty()) << what << ": a proxy or a note why not";
  for (const Proxy& proxy : made.proxies) {
    Findings findings;
    const GlbFacts facts = check_glb(proxy.glb, what, findings, GlbRules::kStandalone);
    EXPECT_TRUE(findings.empty()) << what << ": " << (findings.empty() ? "" : findings.list().front().found);
    EXPECT_EQ(facts.triangles, proxy.triangles) << what;
    EXPECT_EQ(facts.vertices, proxy.vertices) << what;
    EXPECT_LE(proxy.glb.size(), proxy.target_bytes * 102 / 100) << what;
    ASSERT_EQ(proxy.losses.size(), 4u) << what;
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_GE(proxy.losses[i].flip_mean, 0) << what;
      EXPECT_LE(proxy.losses[i].flip_mean, 1) << what;
      EXPECT_GE(proxy.losses[i].flip_p95, 0) << what;
      if (i > 0) {
        EXPECT_GT(proxy.losses[i].displayed_px, proxy.losses[i - 1].displayed_px) << what;
      }
    }
  }
}

TEST(Proxies, FilesStandAloneFitTheirSizesAndLookBetterWithMoreBytes) {
  const Proxies made =
      proxies_of(textured(testing::bumpy_sphere(80, 160)), {ProxyMode::kAlways, {12000, 30000, 60000}});
  expect_sound(made, "sphere");
  ASSERT_EQ(made.proxies.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT(made.proxies[i].losses[0].flip_mean, 0.08);
    EXPECT_EQ(made.proxies[i].textures.front().use, "base-colour");
    if (i == 0) continue;
    EXPECT_GT(made.proxies[i].glb.size(), made.proxies[i - 1].glb.size());
    EXPECT_LT(made.proxies[i].losses[2].flip_mean, made.proxies[i - 1].losses[2].flip_mean);
  }
}

TEST(Proxies, ManyThreadsGiveTheBytesOfOne) {
  const ProxyModel model = noisy(testing::bumpy_sphere(40, 80));
  const ProxiesOptions options{ProxyMode::kAlways, {10000, 20000, 110000}};
  const Proxies one = proxies_of(model, options, 1), eight = proxies_of(model, options, 8);
  ASSERT_EQ(one.proxies.size(), 3u);
  ASSERT_EQ(eight.proxies.size(), 3u);
  for (std::size_t i = 0; i < one.proxies.size(); ++i) {
    EXPECT_EQ(one.proxies[i].glb, eight.proxies[i].glb);
    EXPECT_EQ(one.proxies[i].losses, eight.proxies[i].losses);
  }
}

TEST(Proxies, NoneAreMadeWhereNoneAreWanted) {
  const Proxies made = proxies_of(textured(testing::sphere(10, 20)), {ProxyMode::kNone, {20000}});
  EXPECT_TRUE(made.proxies.empty());
  EXPECT_TRUE(made.notes.empty());
}

ProxyModel one_triangle() {
  Mesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.wedge_position = {0, 1, 2};
  m.triangles = {{0, 1, 2}};
  m.triangle_material = {0};
  m.triangle_part = {0};
  m.part_names = {"part"};
  return {std::move(m), {Material{}}, {}, {}, {}};
}

ProxyModel many_materials() {
  ProxyModel out{testing::sphere(20, 40), {}, {}, {}, {}};
  for (std::uint16_t i = 0; i < 220; ++i) {
    Material m;
    m.base_colour = {static_cast<float>(i) / 220, 0.5f, 0.5f, 1};
    m.metallic = 0;
    m.double_sided = i % 3 == 0;
    m.unlit = i % 5 == 0;
    m.alpha_mode = i % 7 == 0 ? AlphaMode::kBlend : i % 11 == 0 ? AlphaMode::kMask : AlphaMode::kOpaque;
    out.materials.push_back(m);
  }
  for (std::size_t t = 0; t < out.mesh.triangles.size(); ++t)
    out.mesh.triangle_material[t] = static_cast<std::uint16_t>(t % 220);
  return out;
}

ProxyModel masked() {
  ProxyModel out = textured(testing::sheet(20));
  out.materials[0].alpha_mode = AlphaMode::kMask;
  out.materials[0].double_sided = true;
  add_plane(out, TextureRole::kAlpha, 256,
            [](auto x, auto y, auto) { return (x / 32 + y / 32) % 2 ? 255 : 0; });
  return out;
}

/// The lower half has another material, without a texture, and coordinates without area.
ProxyModel partly_without_coordinates() {
  ProxyModel out = textured(testing::bumpy_sphere(20, 40));
  out.materials.emplace_back().base_colour = {0.2f, 0.8f, 0.3f, 1};
  for (std::uint32_t t = 0; t < out.mesh.triangles.size(); ++t) {
    if (out.mesh.positions[out.mesh.position_of(t, 0)].y > 0) continue;
    out.mesh.triangle_material[t] = 1;
    for (const std::uint32_t w : out.mesh.triangles[t]) out.mesh.uv0[w] = {0, 0};
  }
  return out;
}

/// Leaves: small sheets in all directions, seen from both sides, cut out by the texture's alpha.
ProxyModel leaves(AlphaMode mode) {
  std::vector<Mesh> sheets;
  for (int i = 0; i < 60; ++i) {
    Mesh& m = sheets.emplace_back(testing::sheet(2, 0.1f));
    for (Vec3f& p : m.positions)
      p = i % 3 == 0 ? p : i % 3 == 1 ? Vec3f{p.z, p.x, p.y} : Vec3f{p.y, p.z, p.x};
  }
  ProxyModel out = textured(testing::side_by_side(sheets, -0.3f));
  out.materials[0].alpha_mode = mode;
  out.materials[0].double_sided = true;
  add_plane(out, TextureRole::kAlpha, 256, [](auto x, auto y, auto) {
    const auto dx = static_cast<int>(x) - 128, dy = static_cast<int>(y) - 128;
    return dx * dx + dy * dy < 100 * 100 ? 230 : 0;
  });
  return out;
}

ProxyModel changed(ProxyModel model, const std::function<void(ProxyModel&)>& change) {
  change(model);
  return model;
}

/// One that is baked, and a larger one that may be a scale.
void expect_sound_ones(const std::string& what, const ProxyModel& model) {
  expect_sound(proxies_of(model, {ProxyMode::kAlways, {8000, 100000}}), what);
}

TEST(Proxies, HardMaterialsHaveAProxyOrANote) {
  const ProxyModel sphere = textured(testing::bumpy_sphere(20, 40));
  const std::vector<std::pair<std::string, ProxyModel>> models{
      {"220 materials", many_materials()},
      {"alpha mask", masked()},
      {"blended sheet", changed(textured(testing::sheet(20)),
                                [](ProxyModel& m) { m.materials[0].alpha_mode = AlphaMode::kBlend; })},
      {"blended leaves", leaves(AlphaMode::kBlend)},
      {"leaves cut out", leaves(AlphaMode::kMask)},
      {"no coordinates", changed(sphere, [](ProxyModel& m) { m.mesh.uv0.clear(); })},
      {"coordinates of one material only", partly_without_coordinates()},
      {"coordinates without area", changed(sphere,
                                           [](ProxyModel& m) {
                                             for (Vec2f& uv : m.mesh.uv0) uv = {0.5f, 0.5f};
                                           })},
      {"vertex colours", changed(sphere, [](ProxyModel& m) {
         m.mesh.uv0.clear();
         for (const std::uint32_t p : m.mesh.wedge_position)
           m.mesh.colours.push_back({m.mesh.positions[p].x * 0.4f + 0.5f, 0.5f, 0.2f, 1});
       })}};
  for (const auto& [what, model] : models) expect_sound_ones(what, model);
}

TEST(Proxies, HardShapesHaveAProxyOrANote) {
  const ProxyModel sphere = textured(testing::bumpy_sphere(20, 40));
  const auto turned = [](const Mesh& mesh, std::uint32_t every) {
    ProxyModel out = textured(mesh);
    for (std::uint32_t t = 0; t < out.mesh.triangles.size(); t += every)
      std::swap(out.mesh.triangles[t][1], out.mesh.triangles[t][2]);
    return out;
  };
  const Mesh pair =
      testing::side_by_side({testing::bumpy_sphere(15, 30), testing::inside_out(testing::cube())});
  const std::vector<std::pair<std::string, ProxyModel>> models{
      {"one triangle", one_triangle()},
      {"open sheet", textured(testing::sheet(20))},
      {"slivers", textured(testing::sliver_sheet(20))},
      {"inside out", textured(testing::inside_out(testing::bumpy_sphere(20, 40)))},
      {"a part inside out", textured(pair)},
      {"every third triangle inside out", turned(testing::bumpy_sphere(20, 40), 3)},
      {"far away", changed(sphere,
                           [](ProxyModel& m) {
                             for (Vec3f& p : m.mesh.positions) p = p * 1000.0f + Vec3f{1e7f, 1e7f, -1e7f};
                           })},
      {"huge", changed(sphere,
                       [](ProxyModel& m) {
                         for (Vec3f& p : m.mesh.positions) p = p * 1e7f;
                       })},
      {"no extent", changed(sphere,
                            [](ProxyModel& m) {
                              for (Vec3f& p : m.mesh.positions) p = {1, 1, 1};
                            })},
      {"500 pebbles", textured(testing::side_by_side(std::vector<Mesh>(500, testing::cube())))}};
  for (const auto& [what, model] : models)
    expect_sound(proxies_of(model, {ProxyMode::kAlways, {8000}}), what);
}

TEST(Proxies, TheFirstNeedsNoDracoAndLargerOnesDo) {
  const Proxies made =
      proxies_of(textured(testing::bumpy_sphere(40, 80)), {ProxyMode::kAlways, {10000, 25000}});
  ASSERT_EQ(made.proxies.size(), 2u);
  const auto codec = [](const Proxy& proxy) {
    Findings findings;
    return check_glb(proxy.glb, "proxy", findings, GlbRules::kStandalone).codec;
  };
  EXPECT_EQ(codec(made.proxies[0]), "meshopt");
  EXPECT_EQ(codec(made.proxies[1]), "draco");
}

TEST(Proxies, TinyMeshesKeepTheSourcesAtlas) {
  const Proxies made = proxies_of(textured(testing::sphere(10, 20)), {ProxyMode::kAuto, {20000, 50000}});
  EXPECT_TRUE(made.proxies.empty());
  EXPECT_EQ(made.notes.size(), 2u);
}

/// A file of so many bytes stands for the source's images.
ProxyModel with_source(ProxyModel model, std::size_t bytes) {
  model.images.at(0).bytes.resize(bytes);
  return model;
}

std::size_t notes_saying(const Proxies& made, const std::string& part) {
  return static_cast<std::size_t>(std::ranges::count_if(
      made.notes, [&](const Note& note) { return note.text.find(part) != std::string::npos; }));
}

/// A bumpy sphere, and a scale of one of `every` rings.
NestedScales two_scales(std::uint32_t rings, std::uint32_t every) {
  NestedScales out = only_scale(testing::bumpy_sphere(rings, 2 * rings));
  const std::uint32_t columns = 2 * rings / every + 1, finest_columns = 2 * rings + 1;
  NestedScale scale;
  scale.scale = 1;
  for (const Triangle& t : testing::bumpy_sphere(rings / every, 2 * rings / every).triangles) {
    Triangle on_finest;
    for (std::size_t k = 0; k < 3; ++k)
      on_finest[k] = t[k] / columns * every * finest_columns + t[k] % columns * every;
    scale.triangles.push_back(on_finest);
    scale.triangle_source.push_back(0);
  }
  out.scales.push_back(std::move(scale));
  return out;
}

Proxies proxies_of_scales(const NestedScales& scales, const ProxyModel& model, std::vector<int> sizes) {
  return make_proxies(scales, model.materials, model.images, model.fragments, model.pixels,
                      {ProxyMode::kAuto, std::move(sizes)}, {});
}

TEST(Proxies, EachSizeIsDecidedByItself) {
  // 55 % of the first size hold no mesh. A file of a scale holds S_0 with all texels in the second, and is
  // all that the third could hold.
  const ProxyModel model = with_source(noisy(Mesh{}), 10000000);
  const Proxies made = proxies_of_scales(two_scales(60, 2), model, {8000, 200000, 500000});
  ASSERT_EQ(made.proxies.size(), 2u);
  EXPECT_EQ(made.proxies[0].target_bytes, 8000u);
  EXPECT_EQ(made.proxies[1].target_bytes, 200000u);
  EXPECT_EQ(notes_saying(made, "the whole object takes fewer"), 1u);
}

TEST(Proxies, LargerOnesCompeteWithWhatPlansPay) {
  // Bytes that hold S_0 with all its texels by the lower prices do not in a plan.
  const ProxyModel model = with_source(noisy(testing::bumpy_sphere(60, 120)), 10000000);
  const Proxies made = proxies_of(model, {ProxyMode::kAuto, {60000, 90000}});
  EXPECT_EQ(made.proxies.size(), 2u);
  EXPECT_TRUE(made.notes.empty());
}

TEST(Proxies, TheSmallestStaysWhereALargerOneWins) {
  // The coarse scale beats the first size; S_0 itself does not fit the second.
  const NestedScales scales = two_scales(120, 8);
  const ProxyModel model = with_source(textured(Mesh{}), 10000000);
  const Proxies alone = proxies_of_scales(scales, model, {14000}),
                both = proxies_of_scales(scales, model, {14000, 60000});
  EXPECT_TRUE(alone.proxies.empty());
  EXPECT_EQ(notes_saying(alone, "looks better for the same bytes"), 1u);
  ASSERT_EQ(both.proxies.size(), 2u);
  EXPECT_EQ(both.proxies[0].target_bytes, 14000u);
  EXPECT_TRUE(both.notes.empty());
}

TEST(Proxies, TheyTakeLittleOfASmallSource) {
  const Mesh mesh = testing::bumpy_sphere(80, 160);
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{60000}, std::size_t{600000}}) {
    const Proxies made =
        proxies_of(with_source(noisy(mesh), bytes), {ProxyMode::kAuto, {10000, 20000, 39000}});
    std::size_t sum = 0;
    for (const Proxy& proxy : made.proxies) sum += proxy.glb.size();
    constexpr double kMeshBytes = 75000;  // at most
    EXPECT_LE(static_cast<double>(sum), 0.4 * (static_cast<double>(bytes) + kMeshBytes));
    EXPECT_EQ(made.proxies.size(), bytes == 0 ? 0u : bytes == 60000 ? 2u : 3u);
    EXPECT_EQ(notes_saying(made, bytes == 0 ? "15 % of the source" : "40 % of the source"),
              3 - made.proxies.size());
  }
}

TEST(Proxies, ASourceThatIsLoadedSoonHasNone) {
  const ProxyModel model = with_source(noisy(testing::bumpy_sphere(80, 160)), 60000);
  const Proxies made = proxies_of(model, {ProxyMode::kAuto, {25000, 30000}});
  EXPECT_TRUE(made.proxies.empty());
  EXPECT_EQ(notes_saying(made, "more than 15 % of the source"), 2u);
  EXPECT_EQ(proxies_of(model, {ProxyMode::kAlways, {25000, 30000}}).proxies.size(), 2u);
}

TEST(Proxies, TheFirstDefaultSizeFitsTheFirstRequest) {
  const ProxiesOptions options;
  constexpr int kFirstRequest = 45056, kManifest = 8000;
  EXPECT_LE(options.sizes.front() * 1.02 + kManifest, kFirstRequest);
}

bool says(const Proxy& proxy, const std::string& part) {
  return std::string(proxy.glb.begin(), proxy.glb.end()).find(part) != std::string::npos;
}

TEST(Proxies, ASmoothObjectHasNoFacets) {
  const ProxyModel smooth = textured(testing::bumpy_sphere(20, 40));
  for (const Proxy& proxy : proxies_of(smooth, {ProxyMode::kAlways, {6000}}).proxies)
    EXPECT_TRUE(says(proxy, "\"NORMAL\""));
  const ProxyModel facets = textured(testing::cube());
  for (const Proxy& proxy : proxies_of(facets, {ProxyMode::kAlways, {6000}}).proxies)
    EXPECT_FALSE(says(proxy, "\"NORMAL\""));
}

TEST(Proxies, TexturesAreReadWithMipLevelsWhereTheSourcesAre) {
  ProxyModel model = textured(testing::bumpy_sphere(20, 40));
  model.materials.push_back(model.materials[0]);
  const auto reads_mips = [&](Minification first, Minification second) {
    model.materials[0].base_colour_texture.minification = first;
    model.materials[1].base_colour_texture.minification = second;
    const Proxies made = proxies_of(model, {ProxyMode::kAlways, {8000}});
    const bool with = says(made.proxies.at(0), "\"minFilter\":9987"),
               without = says(made.proxies.at(0), "\"minFilter\":9729");
    EXPECT_NE(with, without);
    return with;
  };
  EXPECT_TRUE(reads_mips(Minification::kLinearMipmapLinear, Minification::kLinearMipmapLinear));
  EXPECT_TRUE(reads_mips(Minification::kLinear, Minification::kNearestMipmapNearest));
  EXPECT_FALSE(reads_mips(Minification::kLinear, Minification::kNearest));
}

TEST(Proxies, VertexColoursBecomeTexels) {
  ProxyModel model = textured(testing::sphere(20, 40));
  model.mesh.uv0.clear();
  model.mesh.colours.assign(model.mesh.wedge_count(), {1, 0.1f, 0.1f, 1});
  const Proxies made = proxies_of(model);
  ASSERT_EQ(made.proxies.size(), 1u);
  EXPECT_LT(made.proxies[0].losses[1].flip_mean, 0.05) << "the colours are there";
}

/// A material and an image for every so many triangles.
ProxyModel of_images(std::size_t count) {
  ProxyModel out = noisy(testing::bumpy_sphere(40, 80));
  while (out.pixels.size() < count) {
    add_plane(out, TextureRole::kBaseColour, 256,
              [&](auto x, auto y, auto c) { return x * y * (c + 1) >> 3; });
    out.fragments.planes.back().image = static_cast<std::uint32_t>(out.pixels.size() - 1);
    out.materials.push_back(out.materials.front());
    out.materials.back().base_colour_texture.image = static_cast<std::int32_t>(out.pixels.size() - 1);
  }
  for (std::size_t t = 0; t < out.mesh.triangles.size(); ++t)
    out.mesh.triangle_material[t] = static_cast<std::uint16_t>(t * count / out.mesh.triangles.size());
  return out;
}

TEST(Proxies, LargeOnesAreScalesWithTheSourcesImages) {
  const Proxies made = proxies_of(of_images(2), {ProxyMode::kAlways, {10000, 200000}});
  expect_sound(made, "two images");
  ASSERT_EQ(made.proxies.size(), 2u);
  EXPECT_FALSE(says(made.proxies[0], "texture/0"));
  const Proxy& large = made.proxies[1];
  EXPECT_TRUE(says(large, "texture/0") && says(large, "texture/1"));
  EXPECT_TRUE(says(large, "KHR_draco_mesh_compression"));
  EXPECT_EQ(large.textures.size(), 2u);
  EXPECT_LT(large.losses[2].flip_mean, made.proxies[0].losses[2].flip_mean);
  EXPECT_GE(large.glb.size(), large.target_bytes * 95 / 100) << "the bytes are used";
}

TEST(Proxies, TheSmallestIsNoScaleForItNeedsNoDecoder) {
  const Proxies made = proxies_of(of_images(2), {ProxyMode::kAlways, {150000}});
  ASSERT_EQ(made.proxies.size(), 1u);
  EXPECT_TRUE(says(made.proxies[0], "EXT_meshopt_compression"));
}

TEST(Proxies, AScaleOfMoreTexturesThanClientsCountIsNone) {
  const Proxies made = proxies_of(of_images(5), {ProxyMode::kAlways, {10000, 100000}});
  ASSERT_EQ(made.proxies.size(), 2u);
  for (const Proxy& proxy : made.proxies) {
    double texels = 0, side = 0;
    for (const ProxyTexture& t : proxy.textures) {
      texels += static_cast<double>(t.width_px) * t.height_px;
      side = std::max({side, static_cast<double>(t.width_px), static_cast<double>(t.height_px)});
    }
    EXPECT_LE(texels, 4 * side * side);
    EXPECT_FALSE(says(proxy, "texture/4"));
  }
}

}  // namespace texmesh::proxies_test
