// How much longer than its bare codecs does `texmesh compile` take? Compiles a model in a process of its own,
// then codes the very content of the package again with nothing but the codecs, in this process, one thread:
// Draco over every scale's mesh with the same bits and level, libjpeg-turbo over every fragment of every
// rung. The ratio of the two walls is taken within one run, so that the machine's speed and load cancel out.
#include <draco/attributes/attribute_quantization_transform.h>
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "format/model/model.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"

extern char** environ;

namespace {

using namespace texmesh;  // NOLINT: a program's main file
using Clock = std::chrono::steady_clock;

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct ProcessCost {
  double wall_s = 0, cpu_s = 0, peak_mib = 0;  // the peak is that of the largest process beneath
};

ProcessCost run(std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  argv.push_back(nullptr);
  const auto start = Clock::now();
  pid_t pid = 0;
  int status = 0;
  rusage usage{};
  if (posix_spawn(&pid, argv[0], nullptr, nullptr, argv.data(), environ) != 0 ||
      wait4(pid, &status, 0, &usage) != pid)
    throw InputError(arguments[0], "", "a program that can be run", "none");
  ProcessCost cost;
  cost.wall_s = seconds_since(start);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw InputError(arguments[0], "exit status", "0", std::to_string(status));
  auto seconds = [](timeval t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  cost.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  cost.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024;
  return cost;
}

std::vector<std::span<const char>> draco_streams(const std::vector<std::uint8_t>& glb) {
  auto word = [&glb](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, glb.data() + at, 4);
    return value;
  };
  const std::size_t json_bytes = word(12), bin = 20 + json_bytes + 8;
  const auto json =
      nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(json_bytes));
  std::vector<std::span<const char>> streams;
  for (const auto& mesh : json.at("meshes"))
    for (const auto& primitive : mesh.at("primitives")) {
      const auto& view = json.at("bufferViews")
                             .at(primitive.at("extensions")
                                     .at("KHR_draco_mesh_compression")
                                     .at("bufferView")
                                     .get<std::size_t>());
      streams.emplace_back(
          reinterpret_cast<const char*>(glb.data()) + bin + view.value("byteOffset", std::size_t{0}),
          view.at("byteLength").get<std::size_t>());
    }
  return streams;
}

std::unique_ptr<draco::Mesh> decode(std::span<const char> stream, bool keep_codes) {
  draco::DecoderBuffer buffer;
  buffer.Init(stream.data(), stream.size());
  draco::Decoder decoder;
  if (keep_codes)
    for (auto type : {draco::GeometryAttribute::POSITION, draco::GeometryAttribute::TEX_COORD,
                      draco::GeometryAttribute::NORMAL})
      decoder.SetSkipAttributeTransform(type);
  auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
  if (!mesh.ok()) throw FormatError("package", "draco", "a mesh", mesh.status().error_msg_string());
  return std::move(mesh).value();
}

/// One mesh, ready to be coded with the bits that the package has it in.
struct DracoWork {
  std::unique_ptr<draco::Mesh> mesh;
  std::vector<std::pair<int, int>> bits;  // attribute id, quantisation bits

  explicit DracoWork(std::span<const char> stream) : mesh(decode(stream, false)) {
    const auto codes = decode(stream, true);
    for (int a = 0; a < codes->num_attributes(); ++a) {
      draco::AttributeQuantizationTransform transform;
      if (transform.InitFromAttribute(*codes->attribute(a)))
        bits.emplace_back(a, transform.quantization_bits());
      else if (codes->attribute(a)->attribute_type() == draco::GeometryAttribute::NORMAL)
        bits.emplace_back(a, 10);
    }
  }
  std::size_t code(int level) const {
    draco::ExpertEncoder encoder(*mesh);
    encoder.SetSpeedOptions(10 - level, 10 - level);
    for (const auto& [attribute, n] : bits) encoder.SetAttributeQuantization(attribute, n);
    draco::EncoderBuffer out;
    if (const draco::Status s = encoder.EncodeToBuffer(&out); !s.ok())
      throw FormatError("package", "draco", "a mesh that codes", s.error_msg_string());
    return out.size();
  }
};

/// All fragments of a plane, from its best rung.
struct JpegWork {
  std::vector<Pixels> fragments;
  std::vector<int> qualities;
  std::uint32_t channels = 3;
  bool colour = true;

  JpegWork(PackageReader& package, std::uint32_t plane) {
    const TextureInfo& info = package.textures().at(plane);
    qualities = info.rung_quality;
    channels = info.channels;
    colour = info.colour_space == "srgb";
    const auto top = static_cast<std::uint32_t>(qualities.size() - 1);
    for (std::uint32_t f = 0; f < info.columns * info.rows; ++f)
      if (package.fragment_range(plane, top, f).bytes > 0)
        fragments.push_back(decode_jpeg(package.complete_fragment(plane, top, f), 1u << 28));
  }
  std::size_t code() const {
    std::size_t bytes = 0;
    for (int quality : qualities) {
      JpegCoder coder({channels, quality, Subsampling::k420, !colour && channels == 3});
      std::vector<std::uint8_t> body;
      for (const Pixels& p : fragments) {
        body.clear();
        coder.append_body({p.data.data(), std::size_t{p.width_px} * p.channels, p.width_px, p.height_px},
                          body);
        bytes += body.size();
      }
    }
    return bytes;
  }
};

struct Seconds {
  double wall = 1e300, cpu = 1e300;
};

template <class Work>
Seconds best_of(int repeats, const Work& work) {
  Seconds best;
  for (int i = 0; i < repeats; ++i) {
    const auto start = Clock::now();
    const double cpu = cpu_seconds();
    work();
    best.cpu = std::min(best.cpu, cpu_seconds() - cpu);
    best.wall = std::min(best.wall, seconds_since(start));
  }
  return best;
}

struct CodecCost {
  Seconds draco, jpeg;
  std::size_t draco_bytes = 0, jpeg_bytes = 0, meshes = 0, fragments = 0;
};

CodecCost code_again(PackageReader& package, int repeats) {
  constexpr int kLevel = 7;  // the default of scales.draco_level
  std::vector<DracoWork> meshes;
  for (const ManifestScale& scale : package.manifest().scales) {
    if (!scale.has_glb()) continue;  // the stream alone has it
    const std::vector<std::uint8_t> glb = package.scale_glb(scale.scale);
    for (std::span<const char> stream : draco_streams(glb)) meshes.emplace_back(stream);
  }
  std::vector<JpegWork> planes;
  for (std::uint32_t p = 0; p < package.textures().size(); ++p) planes.emplace_back(package, p);
  CodecCost cost;
  cost.meshes = meshes.size();
  for (const JpegWork& plane : planes) cost.fragments += plane.fragments.size() * plane.qualities.size();
  cost.draco = best_of(repeats, [&] {
    cost.draco_bytes = 0;
    for (const DracoWork& mesh : meshes) cost.draco_bytes += mesh.code(kLevel);
  });
  cost.jpeg = best_of(repeats, [&] {
    cost.jpeg_bytes = 0;
    for (const JpegWork& plane : planes) cost.jpeg_bytes += plane.code();
  });
  return cost;
}

int measure(int argc, char** argv) {
  std::string input;
  int repeats = 3, jobs = 0;
  CLI::App app("Compiles a model and relates the time to that of its bare codecs.");
  app.add_option("input", input,
                 "model; without one, a made scan of 100,000 triangles with three 2048 px textures");
  app.add_option("--repeat", repeats, "the best of so many")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--jobs", jobs, "as of texmesh compile; 0 = its default")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  std::string folder = (std::filesystem::temp_directory_path() / "texmesh-bench-XXXXXX").string();
  if (!mkdtemp(folder.data())) throw InputError(folder, "", "a temporary folder", "none");
  struct Remove {
    std::string path;
    ~Remove() { std::filesystem::remove_all(path); }
  } const remove{folder};
  if (input.empty()) {
    input = folder + "/scan.glb";
    run({TEXMESH_MAKE_SCAN, "-o", input, "--triangles", "100000", "--texture", "2048", "--charts", "1000",
         "--textures"});
  }
  const std::string output = folder + "/model.texmesh";
  std::vector<std::string> command{TEXMESH_BINARY, "compile", input, "-o", output, "--no-cache", "--quiet"};
  if (jobs > 0) command.insert(command.end(), {"--jobs", std::to_string(jobs)});
  ProcessCost best;
  best.wall_s = 1e300;
  for (int i = 0; i < repeats; ++i) {
    std::filesystem::remove(output);
    const ProcessCost cost = run(command);
    const double peak = std::max(best.peak_mib, cost.peak_mib);
    const double cpu = i == 0 ? cost.cpu_s : std::min(best.cpu_s, cost.cpu_s);
    best = {std::min(best.wall_s, cost.wall_s), cpu, peak};
  }
  PackageReader package(open_store(output));
  const CodecCost codecs = code_again(package, repeats);
  std::printf("compile       %8.2f s wall %8.2f s CPU, best of %d; largest process %.0f MiB\n", best.wall_s,
              best.cpu_s, repeats, best.peak_mib);
  std::printf("bare Draco    %8.2f s wall %8.2f s CPU, %zu meshes, %zu bytes\n", codecs.draco.wall,
              codecs.draco.cpu, codecs.meshes, codecs.draco_bytes);
  std::printf("bare libjpeg  %8.2f s wall %8.2f s CPU, %zu fragments, %zu bytes\n", codecs.jpeg.wall,
              codecs.jpeg.cpu, codecs.fragments, codecs.jpeg_bytes);
  // Wall is what a user waits for; CPU is the figure to trust on a machine that others use too.
  std::printf("ratio         %8.2f   wall %8.2f   CPU (whole process to its bare codecs on one thread)\n",
              best.wall_s / (codecs.draco.wall + codecs.jpeg.wall),
              best.cpu_s / (codecs.draco.cpu + codecs.jpeg.cpu));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return measure(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "compile_bench: " << e.what() << '\n';
    return 1;
  }
}
