#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <thread>

#include "examples/scan_model.h"
#include "examples/scan_noise.h"

namespace {

using namespace texmesh;  // NOLINT: an example's main file

void write_model(const ScanOptions& options, const std::string& path, const RunContext& context) {
  const Model model = make_scan(options, context);
  const std::string extension = std::filesystem::path(path).extension().string();
  const std::map<std::string, void (*)(const Model&, const std::string&)> writers{
      {".glb", write_scan_glb}, {".obj", write_scan_obj}, {".ply", write_scan_ply}};
  const auto writer = writers.find(extension);
  if (writer == writers.end())
    throw InputError("make_scan", "-o", "a name that ends in .glb, .obj or .ply", path);
  writer->second(model, path);
  std::printf("%s: %zu triangles, %zu positions, %zu wedges, %zu textures of %d px\n", path.c_str(),
              model.mesh.triangles.size(), model.mesh.positions.size(), model.mesh.wedge_count(),
              model.images.size(), options.texture_px);
}

// A collection: models that differ in form, size and number of charts.
void write_many(ScanOptions options, int count, const std::string& folder, const RunContext& context) {
  std::filesystem::create_directories(folder);
  const ScanOptions base = options;
  for (int i = 0; i < count; ++i) {
    const double size = 0.5 + hash01(static_cast<std::uint32_t>(i), 0, 0, 99);
    options.seed = base.seed + i;
    options.triangles = std::max(48, static_cast<int>(base.triangles * size));
    options.charts = std::max(2, static_cast<int>(base.charts * size));
    char name[32];
    std::snprintf(name, sizeof name, "scan_%05d.glb", i);
    write_model(options, (std::filesystem::path(folder) / name).string(), context);
  }
}

int run(int argc, char** argv) {
  ScanOptions options;
  std::string out = "scan.glb";
  int many = 0;
  bool range_scan = false;
  std::string shape = "rock";
  RunContext context;
  context.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));

  CLI::App app(
      "Makes a scan: an object with a photo-like texture, the same bytes everywhere for equal options.");
  app.add_option("-o,--out", out, "file (.glb, .obj, .ply; .json with --range-scan) or folder (with --many)")
      ->capture_default_str();
  auto number = [&app](const char* name, int& value, int lo, int hi, const char* help) {
    app.add_option(name, value, help)->check(CLI::Range(lo, hi))->capture_default_str();
  };
  app.add_option("--shape", shape, "rock, or owl: a painted one, whole and closed")
      ->check(CLI::IsMember({"rock", "owl"}))
      ->capture_default_str();
  number("--triangles", options.triangles, 48, 50'000'000, "triangles, about");
  number("--texture", options.texture_px, 0, 16384, "side of the textures in px; 0 = vertex colours instead");
  number("--enlarge", options.enlarge, 1, 16,
         "paint textures at this part of their size and enlarge them: 16384 px in seconds");
  number("--charts", options.charts, 2, 20'000, "charts of the texture atlas, about");
  number("--holes", options.holes, 0, 1000, "holes in the surface");
  app.add_option("--noise", options.noise, "measuring noise, fraction of the object's diagonal")
      ->check(CLI::Range(0.0, 0.05))
      ->capture_default_str();
  number("--seed", options.seed, 0, 1'000'000'000, "another seed is another object");
  app.add_flag("--textures", options.all_textures, "normal and occlusion-roughness-metallic maps too");
  number("--jpeg-quality", options.jpeg_quality, 1, 100, "JPEG quality of the textures");
  app.add_flag("--range-scan", range_scan,
               "a cylindrical range scan: JSON, a 16-bit grid of radii, a colour image");
  number("--range-columns", options.range_columns, 8, 16384, "range scan: samples around the axis");
  number("--range-rows", options.range_rows, 4, 16384, "range scan: samples along the axis");
  number("--many", many, 0, 1'000'000, "so many different models, into the folder that -o names");
  number("--threads", context.threads, 1, 256, "threads; the bytes do not depend on them");
  CLI11_PARSE(app, argc, argv);
  if (shape == "owl") {
    options.form = ScanForm::kOwl;
    if (app.count("--holes") == 0) options.holes = 0;
    if (app.count("--noise") == 0) options.noise = 0.0001;
  }

  if (range_scan) {
    if (app.count("-o") == 0) out = "scan.json";
    write_range_scan(make_range_scan(options, context), options.jpeg_quality, out);
    std::printf("%s: %d x %d samples\n", out.c_str(), options.range_columns, options.range_rows);
  } else if (many > 0) {
    write_many(options, many, out, context);
  } else {
    write_model(options, out, context);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "make_scan: " << e.what() << '\n';
    return 1;
  }
}
