// The texture stages against plain libjpeg on the same pixels in the same run. Counters:
//   cpu_ratio    CPU of the stage / CPU of ten whole-image encodes with standard tables (one thread); target
//   <= 1.5 bytes_ratio  bytes of the ladder, tables included / bytes of those ten files; target <= 1.0
//   speedup      wall with one thread / wall with two
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>

#include <jpeglib.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "stages/lut.h"

namespace texmesh {
namespace {

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::uint32_t hash(std::uint32_t x, std::uint32_t y, std::uint32_t c) {
  std::uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ c * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  return (h ^ h >> 12) * 0x297a2d39u >> 16;
}

/// Bilinear noise of one octave, 0..65535.
std::uint32_t octave(std::uint32_t x, std::uint32_t y, std::uint32_t c, std::uint32_t step) {
  const std::uint32_t u = x / step, v = y / step, a = x % step, b = y % step;
  const std::uint64_t top = std::uint64_t{hash(u, v, c)} * (step - a) + std::uint64_t{hash(u + 1, v, c)} * a;
  const std::uint64_t low =
      std::uint64_t{hash(u, v + 1, c)} * (step - a) + std::uint64_t{hash(u + 1, v + 1, c)} * a;
  return static_cast<std::uint32_t>((top * (step - b) + low * b) / (std::uint64_t{step} * step));
}

/// A spectrum like a photograph's: amplitude falls with frequency; colours vary slowly.
Pixels photo_like(std::uint32_t size) {
  Pixels out{size, size, 3, {}};
  out.data.resize(std::size_t{size} * size * 3);
  std::uint8_t* to = out.data.data();
  for (std::uint32_t y = 0; y < size; ++y)
    for (std::uint32_t x = 0; x < size; ++x) {
      std::uint32_t grey = 0;
      for (std::uint32_t step = 128, weight = 64; step >= 1; step /= 2, weight = weight * 5 / 9)
        grey += octave(x, y, step, step) * weight >> 16;
      for (std::uint32_t c = 0; c < 3; ++c)
        *to++ = static_cast<std::uint8_t>(std::min(255u, 10 + grey + (octave(x, y, 200 + c, 64) * 60 >> 16)));
    }
  return out;
}

struct Scene {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Scene make_scene(std::uint32_t size, std::uint32_t side) {
  Scene scene;
  TexturePlane p;
  p.channels = 3;
  p.width_px = p.height_px = size;
  p.fragment_width_px = p.fragment_height_px = side;
  p.columns = p.rows = size / side;
  p.coverage.assign(std::size_t{size} / 8 * size, 0xff);
  p.covered_texels.assign(p.fragment_count(), side * side);
  p.surface_fraction.assign(p.fragment_count(), 1.0f / static_cast<float>(p.fragment_count()));
  p.features.assign(p.fragment_count(), 1);
  p.eta.assign(p.fragment_count(), 0);
  scene.fragments.planes = {p};
  scene.pixels = {photo_like(size)};
  return scene;
}

/// Plain libjpeg as any program calls it: one file, standard Huffman tables. Returns its bytes.
std::size_t plain_encode(const Pixels& pixels, int quality) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &out, &size);
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(pixels.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::free(out);
  return size;
}

RunContext threads(int count) {
  RunContext context;
  context.threads = count;
  return context;
}

void encode_ladder_bench(benchmark::State& state) {
  const Scene scene =
      make_scene(static_cast<std::uint32_t>(state.range(0)), static_cast<std::uint32_t>(state.range(1)));
  const LadderOptions options;
  double plain = 0, ours = 0, one = 0, two = 0;
  std::size_t plain_bytes = 0, our_bytes = 0;
  for (auto _ : state) {
    double start = cpu_seconds();
    plain_bytes = 0;
    for (int quality : options.rungs) plain_bytes += plain_encode(scene.pixels[0], quality);
    plain += cpu_seconds() - start;
    start = cpu_seconds();
    double wall = wall_seconds();
    const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, options, threads(1));
    ours += cpu_seconds() - start;
    one += wall_seconds() - wall;
    wall = wall_seconds();
    benchmark::DoNotOptimize(encode_ladder(scene.fragments, scene.pixels, options, threads(2)));
    two += wall_seconds() - wall;
    our_bytes = 0;
    for (const LadderRung& rung : ladder.planes[0].rungs) our_bytes += rung.data.size() + rung.tables.size();
  }
  state.counters["cpu_ratio"] = ours / plain;
  state.counters["bytes_ratio"] = static_cast<double>(our_bytes) / static_cast<double>(plain_bytes);
  state.counters["speedup"] = one / two;
}
BENCHMARK(encode_ladder_bench)
    ->Args({1024, 128})
    ->Args({2048, 128})
    ->Args({2048, 256})
    ->Args({4096, 256})
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1);

void build_tables_bench(benchmark::State& state) {
  const Scene scene =
      make_scene(static_cast<std::uint32_t>(state.range(0)), static_cast<std::uint32_t>(state.range(1)));
  const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, {}, threads(2));
  const Predictors predictors = predict_quality(scene.fragments, scene.pixels, {}, threads(2));
  double plain = 0, ours = 0, one = 0, two = 0;
  for (auto _ : state) {
    double start = cpu_seconds();
    for (int quality : LadderOptions{}.rungs)
      benchmark::DoNotOptimize(plain_encode(scene.pixels[0], quality));
    plain += cpu_seconds() - start;
    start = cpu_seconds();
    double wall = wall_seconds();
    benchmark::DoNotOptimize(build_tables(scene.fragments, scene.pixels, predictors, ladder, {}, threads(1)));
    ours += cpu_seconds() - start;
    one += wall_seconds() - wall;
    wall = wall_seconds();
    benchmark::DoNotOptimize(build_tables(scene.fragments, scene.pixels, predictors, ladder, {}, threads(2)));
    two += wall_seconds() - wall;
  }
  state.counters["cpu_ratio"] = ours / plain;
  state.counters["speedup"] = one / two;
}
BENCHMARK(build_tables_bench)->Args({2048, 256})->Unit(benchmark::kMillisecond)->MinTime(1);

/// Half of the texture uncovered, in discs as charts leave gaps.
void fill_bench(benchmark::State& state) {
  const auto size = static_cast<std::uint32_t>(state.range(0));
  const Pixels source = photo_like(size);
  std::vector<std::uint8_t> coverage(std::size_t{size} / 8 * size);
  for (std::uint32_t y = 0; y < size; ++y)
    for (std::uint32_t x = 0; x < size; ++x) {
      const std::int64_t dx = static_cast<std::int64_t>(x % 300) - 150,
                         dy = static_cast<std::int64_t>(y % 300) - 150;
      if (dx * dx + dy * dy < 120 * 120)
        coverage[std::size_t{size} / 8 * y + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
    }
  for (auto _ : state) {
    state.PauseTiming();
    Pixels pixels = source;
    state.ResumeTiming();
    fill_uncovered(pixels, coverage, threads(1));
    benchmark::DoNotOptimize(pixels.data.data());
  }
}
BENCHMARK(fill_bench)->Arg(2048)->Arg(4096)->Unit(benchmark::kMillisecond);

/// A sheet of n x n quads, two triangles each, over one texture that four roles share the size of.
void fragment_bench(benchmark::State& state) {
  const auto n = static_cast<std::uint32_t>(state.range(0));
  ConditionedMesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) {
      const float x = static_cast<float>(i) / static_cast<float>(n),
                  y = static_cast<float>(j) / static_cast<float>(n);
      mesh.mesh.positions.push_back({x, y, 0});
      mesh.mesh.uv0.push_back({x, y});
      mesh.mesh.wedge_position.push_back(j * (n + 1) + i);
      mesh.twin.push_back(j * (n + 1) + i);
    }
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i, b = a + n + 1;
      mesh.mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.mesh.triangles.push_back({a, b + 1, b});
    }
  mesh.mesh.triangle_material.assign(mesh.mesh.triangles.size(), 0);
  ScaleMap scale_map;
  scale_map.scales = 20;
  for (std::size_t p = 0; p < mesh.mesh.positions.size(); ++p)
    scale_map.crossing.push_back(static_cast<std::uint8_t>(p % 21));
  // Different wrap modes keep the four from sharing one measurement.
  Material material;
  TextureRef Material::*const slots[] = {&Material::base_colour_texture, &Material::normal_texture,
                                         &Material::occlusion_texture, &Material::emissive_texture};
  std::vector<Image> images(4);
  for (int k = 0; k < 4; ++k) {
    (material.*slots[k]).image = k;
    (material.*slots[k]).wrap_s = k % 2 ? Wrap::kClamp : Wrap::kRepeat;
    (material.*slots[k]).wrap_t = k / 2 ? Wrap::kClamp : Wrap::kRepeat;
    images[static_cast<std::size_t>(k)].width_px = images[static_cast<std::size_t>(k)].height_px = 2048;
    images[static_cast<std::size_t>(k)].channels = 3;
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(fragment_textures(mesh, {material}, images, scale_map, {}, threads(1)));
}
BENCHMARK(fragment_bench)->Arg(224)->Unit(benchmark::kMillisecond);  // 100,352 triangles

}  // namespace
}  // namespace texmesh

BENCHMARK_MAIN();
