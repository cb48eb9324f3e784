// Sizes, time and memory of the texture ladder against plain libjpeg on the same pixels, in one run:
//   ladder_figures_bench [--side PX] IMAGE...     images cut into fragments of PX (256) by PX
//   ladder_figures_bench --time PX                a made texture of PX by PX: time and memory
// Without images: made textures. Sizes are percent: the ladder's rung, table stream included, over one
// whole-image file with standard Huffman tables (aim: at most 100 at every rung) and over one with optimised
// tables (aim: at most 102 with 256 px, 105 with 128 px from quality 20 on), and, as the third line, what
// fragments of the same coefficients take of the latter with the best tables there can be: what is above 100
// there is the price of cutting, mostly DC steps from the end of a row to the next one's begin.
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "stages/image/decode_image.h"
#include "stages/ladder/encode_rungs.h"
#include "stages/ladder/ladder.h"
#include "stages/previews/previews.h"
#include "tests/bench/bench_texture.h"
#include "tests/support/all_rungs.h"

namespace texmesh {
namespace {

/// A field of /proc/self/status in MB.
double status_mb(const std::string& field) {
  std::ifstream in("/proc/self/status");
  for (std::string word; in >> word;)
    if (word == field + ":") {
      double kib = 0;
      in >> kib;
      return kib / 1024;
    }
  return 0;
}

/// The least that any tables make of fragments with the file's coefficients: tables made for exactly them.
std::size_t least_bytes(const std::vector<std::uint8_t>& file, const TexturePlane& plane) {
  const Image image = probe_image("whole", file, {});
  const Pixels pixels = decode_image(image);
  const LadderOptions options;
  const SourceCodec source = make_source_codec(plane, pixels, image, options, false, threads(2));
  if (!source.codec) return 0;
  const std::vector<CodecRung> rungs = source.codec->train({}, threads(2));
  const std::size_t top = rungs.size() - 1;
  const auto encoder = source.codec->encoder(std::span(&top, 1));
  std::vector<std::uint8_t> streams;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    encoder->encode(fragment_window(plane, pixels, options.uncovered, f), std::span(&streams, 1));
  return streams.size() + rungs[top].table_stream.size();
}

double percent(std::size_t part, std::size_t whole) {
  return 100 * static_cast<double>(part) / static_cast<double>(whole);
}

void print_sizes(const std::string& name, const Scene& scene) {
  const LadderOptions options = testing::all_rungs();
  const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, {}, {}, options, threads(2));
  const TexturePlane& plane = scene.fragments.planes[0];
  std::printf("%s: %zu fragments of %u px\n  quality      ", name.c_str(), plane.fragment_count(),
              plane.fragment_width_px);
  std::string over_plain = "\n  % of standard ", over_optimised = "\n  % of optimised";
  std::string least = "\n  least possible";
  std::size_t ours_sum = 0, plain_sum = 0;
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    const std::size_t ours = rung.data.size() + rung.table_stream.size();
    const std::size_t plain = plain_encode(scene.pixels[0], rung.quality, false);
    const std::vector<std::uint8_t> optimised = plain_file(scene.pixels[0], rung.quality, true);
    char text[3][16];
    std::snprintf(text[0], sizeof text[0], "%7.2f", percent(ours, plain));
    std::snprintf(text[1], sizeof text[1], "%7.2f", percent(ours, optimised.size()));
    std::snprintf(text[2], sizeof text[2], "%7.2f", percent(least_bytes(optimised, plane), optimised.size()));
    over_plain += text[0];
    over_optimised += text[1];
    least += text[2];
    std::printf(" %6d", rung.quality);
    ours_sum += ours;
    plain_sum += plain;
  }
  std::printf("%s%s%s\n  all rungs: %.2f %% of standard files\n", over_plain.c_str(), over_optimised.c_str(),
              least.c_str(), percent(ours_sum, plain_sum));
}

void print_memory(const Scene& scene, int count) {
  ::malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // resets the peak
  const double before = status_mb("VmRSS");
  const Previews previews = make_previews(scene.fragments, scene.pixels, {}, threads(count));
  const Ladder ladder =
      encode_ladder(scene.fragments, scene.pixels, previews, {}, testing::all_rungs(), threads(count));
  const double peak = status_mb("VmHWM") - before;
  double result = static_cast<double>(previews.planes[0].file.size());
  for (const LadderRung& rung : ladder.planes[0].rungs)
    result += static_cast<double>(rung.data.size() + rung.table_stream.size());
  result /= 1 << 20;
  std::printf(
      "  %d thread(s): memory grows by %.1f MB, of which the result is %.1f MB; the image has %.1f MB\n",
      count, peak, result, static_cast<double>(scene.pixels[0].data.size()) / (1 << 20));
}

void print_time(const Scene& scene) {
  constexpr int kRepeats = 3;
  double plain = 1e30, ours = 1e30, one = 1e30, two = 1e30;
  for (int k = 0; k < kRepeats; ++k) {
    double cpu = cpu_seconds();
    for (const int quality : LadderOptions{}.rungs) plain_encode(scene.pixels[0], quality, false);
    plain = std::min(plain, cpu_seconds() - cpu);
    cpu = cpu_seconds();
    double wall = wall_seconds();
    encode_ladder(scene.fragments, scene.pixels, {}, {}, testing::all_rungs(), threads(1));
    ours = std::min(ours, cpu_seconds() - cpu);
    one = std::min(one, wall_seconds() - wall);
    wall = wall_seconds();
    encode_ladder(scene.fragments, scene.pixels, {}, {}, testing::all_rungs(), threads(2));
    two = std::min(two, wall_seconds() - wall);
  }
  std::printf(
      "  ten standard files %.2f s CPU, ladder %.2f s CPU: ratio %.2f; wall %.2f s on 1 thread, %.2f s on 2: "
      "speed-up %.2f\n",
      plain, ours, ours / plain, one, two, one / two);
}

std::vector<std::uint8_t> bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

int run(const std::vector<std::string>& args) {
  std::uint32_t side = 256;
  std::vector<std::string> images;
  for (std::size_t k = 0; k < args.size(); ++k) {
    if (args[k] == "--side" && k + 1 < args.size()) {
      side = static_cast<std::uint32_t>(std::stoul(args[++k]));
    } else if (args[k] == "--time" && k + 1 < args.size()) {
      const Scene scene = make_scene(made_texture(static_cast<std::uint32_t>(std::stoul(args[++k]))), side);
      std::printf("made texture of %u px\n", scene.pixels[0].width_px);
      print_memory(scene, 1);
      print_memory(scene, 2);
      print_time(scene);
      return 0;
    } else {
      images.push_back(args[k]);
    }
  }
  for (const std::string& path : images) {
    Pixels pixels = decode_image(probe_image(path, bytes_of(path), {}));
    if (pixels.channels != 3) continue;
    print_sizes(std::filesystem::path(path).filename().string(), make_scene(std::move(pixels), side));
  }
  if (images.empty()) {
    print_sizes("made texture", make_scene(made_texture(2048), 128));
    print_sizes("made texture", make_scene(made_texture(4096), 256));
  }
  return 0;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  try {
    return texmesh::run({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
