// Sizes, time and memory of the texture ladder against plain libjpeg on the same pixels, in one run:
//   ladder_figures_bench [--side PX] IMAGE...     images cut into fragments of PX (256) by PX
//   ladder_figures_bench --time PX                a made texture of PX by PX: time and memory
// Without images: made textures. Sizes are percent: the ladder's rung, table stream included, over one
// whole-image file with standard Huffman tables (aim: at most 100 at every rung) and over one with optimised
// tables (aim: at most 102 with 256 px, 105 with 128 px from quality 20 on), and, as the third line, what
// fragments of the same coefficients take of the latter with the best tables there can be: what is above 100
// there is the price of cutting, mostly DC steps from the end of a row to the next one's begin.
#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <jpeglib.h>

#include "stages/ladder.h"
#include "stages/lossless_top.h"

namespace texmesh {
namespace {

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}
double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

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

/// A spectrum like a photograph's down to 128 px, and nothing coarser: neighbouring rows of a fragment are as
/// different as any two, so every row begins with a large DC step, and fragments have more rows than the
/// whole image. It costs up to 3 % against one optimised file where scans cost less than 2.
Pixels made_texture(std::uint32_t size) {
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

/// Every fragment covered; the image is cut to whole fragments.
Scene make_scene(Pixels image, std::uint32_t side) {
  Scene scene;
  TexturePlane p;
  p.channels = image.channels;
  p.fragment_width_px = p.fragment_height_px = side;
  p.columns = std::max(1u, image.width_px / side);
  p.rows = std::max(1u, image.height_px / side);
  p.width_px = p.columns * side;
  p.height_px = p.rows * side;
  p.covered_texels.assign(p.fragment_count(), side * side);
  if (p.width_px != image.width_px || p.height_px != image.height_px) {
    Pixels cut{p.width_px, p.height_px, image.channels, {}};
    for (std::uint32_t y = 0; y < cut.height_px; ++y)
      cut.data.insert(cut.data.end(), image.at(0, y),
                      image.at(0, y) + std::size_t{cut.width_px} * cut.channels);
    image = std::move(cut);
  }
  scene.fragments.planes = {p};
  scene.pixels.push_back(std::move(image));
  return scene;
}

RunContext threads(int count) {
  RunContext context;
  context.threads = count;
  return context;
}

/// Plain libjpeg as any program calls it: one file.
std::vector<std::uint8_t> plain_file(const Pixels& pixels, int quality, bool optimised) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &out, &size);
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = static_cast<int>(pixels.channels);
  info.in_color_space = pixels.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  info.optimize_coding = optimised ? TRUE : FALSE;
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(pixels.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::vector<std::uint8_t> file(out, out + size);
  std::free(out);
  return file;
}

std::size_t plain_encode(const Pixels& pixels, int quality, bool optimised) {
  return plain_file(pixels, quality, optimised).size();
}

/// The least that any tables make of fragments with the file's coefficients: tables made for exactly them.
std::size_t least_bytes(const std::vector<std::uint8_t>& file, const TexturePlane& plane) {
  std::string why_not;
  const auto rung = cut_coefficients(plane, probe_image("whole", file, {}), why_not, threads(2));
  return rung ? rung->data.size() + rung->tables.size() : 0;
}

double percent(std::size_t part, std::size_t whole) {
  return 100 * static_cast<double>(part) / static_cast<double>(whole);
}

void print_sizes(const std::string& name, const Scene& scene) {
  const LadderOptions options;
  const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, options, threads(2));
  const TexturePlane& plane = scene.fragments.planes[0];
  std::printf("%s: %zu fragments of %u px\n  quality      ", name.c_str(), plane.fragment_count(),
              plane.fragment_width_px);
  std::string over_plain = "\n  % of standard ", over_optimised = "\n  % of optimised";
  std::string least = "\n  least possible";
  std::size_t ours_sum = 0, plain_sum = 0;
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    const std::size_t ours = rung.data.size() + rung.tables.size();
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
  const Ladder ladder = encode_ladder(scene.fragments, scene.pixels, {}, threads(count));
  const double peak = status_mb("VmHWM") - before;
  double result = static_cast<double>(ladder.planes[0].preview.size());
  for (const LadderRung& rung : ladder.planes[0].rungs)
    result += static_cast<double>(rung.data.size() + rung.tables.size());
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
    encode_ladder(scene.fragments, scene.pixels, {}, threads(1));
    ours = std::min(ours, cpu_seconds() - cpu);
    one = std::min(one, wall_seconds() - wall);
    wall = wall_seconds();
    encode_ladder(scene.fragments, scene.pixels, {}, threads(2));
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
