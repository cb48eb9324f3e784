// The texture stages against plain libjpeg on the same pixels in the same run. Counters:
//   cpu_ratio    CPU of the stage / CPU of ten whole-image encodes with standard tables, one thread;
//                target <= 1.5
//   bytes_ratio  bytes of the ladder, tables included / bytes of those ten files; target <= 1.0
//   speedup      wall with one thread / wall with two
//   two_s        wall with two threads in seconds
// Each counter is of the best of a case's repetitions. `--large` adds a texture of 8192 px (some 40 s; target
// two_s <= 6). ladder_figures_bench --time 8192 says how much memory such a texture takes.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

#include "stages/fill/fill.h"
#include "stages/fragmentation/fragmentation.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/bench/bench_texture.h"
#include "tests/support/all_rungs.h"

namespace texmesh {
namespace {

/// A made texture of argument 0 px in fragments of argument 1 px.
Scene made_scene(const benchmark::State& state) {
  return make_scene(made_texture(static_cast<std::uint32_t>(state.range(0))),
                    static_cast<std::uint32_t>(state.range(1)));
}

struct Cost {
  double wall_s = 1e300, cpu_s = 1e300;
};

/// The best so far, and this one.
template <class Work>
Cost best(Cost so_far, const Work& work) {
  const double cpu = cpu_seconds(), wall = wall_seconds();
  work();
  return {std::min(so_far.wall_s, wall_seconds() - wall), std::min(so_far.cpu_s, cpu_seconds() - cpu)};
}

void encode_ladder_bench(benchmark::State& state) {
  const Scene scene = made_scene(state);
  const LadderOptions options = testing::all_rungs();
  Cost plain, one, two;
  std::size_t plain_bytes = 0, our_bytes = 0;
  for (auto _ : state) {
    plain = best(plain, [&] {
      plain_bytes = 0;
      for (int quality : options.rungs) plain_bytes += plain_encode(scene.pixels[0], quality, false);
    });
    one = best(one, [&] {
      const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, {}, {}, options, threads(1));
      our_bytes = 0;
      for (const LadderRung& rung : ladder.planes[0].rungs)
        our_bytes += rung.data.size() + rung.table_stream.size();
    });
    two = best(two, [&] {
      benchmark::DoNotOptimize(encode_ladder(scene.fragments, scene.pixels, {}, {}, options, threads(2)));
    });
  }
  state.counters["cpu_ratio"] = one.cpu_s / plain.cpu_s;
  state.counters["bytes_ratio"] = static_cast<double>(our_bytes) / static_cast<double>(plain_bytes);
  state.counters["speedup"] = one.wall_s / two.wall_s;
  state.counters["two_s"] = two.wall_s;
}
BENCHMARK(encode_ladder_bench)
    ->Args({1024, 128})
    ->Args({2048, 128})
    ->Args({2048, 256})
    ->Args({4096, 256})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(5);

void build_tables_bench(benchmark::State& state) {
  const Scene scene = made_scene(state);
  const Previews previews = make_previews(scene.fragments, scene.pixels, {}, threads(2));
  const Ladder ladder =
      encode_ladder(scene.fragments, scene.pixels, previews, {}, testing::all_rungs(), threads(2));
  const Predictors predictors = predict_quality(scene.fragments, scene.pixels, {}, threads(2));
  Cost plain, one, two;
  const auto build = [&](int count) {
    benchmark::DoNotOptimize(
        build_tables(scene.fragments, scene.pixels, predictors, ladder, previews, {}, threads(count)));
  };
  for (auto _ : state) {
    plain = best(plain, [&] {
      for (int quality : LadderOptions{}.rungs)
        benchmark::DoNotOptimize(plain_encode(scene.pixels[0], quality, false));
    });
    one = best(one, [&] { build(1); });
    two = best(two, [&] { build(2); });
  }
  state.counters["cpu_ratio"] = one.cpu_s / plain.cpu_s;
  state.counters["speedup"] = one.wall_s / two.wall_s;
  state.counters["two_s"] = two.wall_s;
}
BENCHMARK(build_tables_bench)->Args({2048, 256})->Unit(benchmark::kMillisecond)->Iterations(5);

/// Half of the texture uncovered, in discs as charts leave gaps.
void fill_bench(benchmark::State& state) {
  const auto size = static_cast<std::uint32_t>(state.range(0));
  const Pixels source = made_texture(size);
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

int main(int argc, char** argv) {
  const auto large = std::find(argv + 1, argv + argc, std::string_view("--large"));
  if (large != argv + argc) {
    std::copy(large + 1, argv + argc, large);
    --argc;
    benchmark::RegisterBenchmark("encode_ladder_bench", texmesh::encode_ladder_bench)
        ->Args({8192, 256})
        ->Unit(benchmark::kMillisecond)
        ->Iterations(3);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
