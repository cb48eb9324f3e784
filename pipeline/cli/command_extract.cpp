#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <thread>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/units.h"
#include "pipeline/extract/extract.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

struct ExtractArguments {
  std::string package, output, bytes, rung = "max", images = "auto";
  int scale = -1, jobs = 0;
  double display_px = 0;
  bool lods = false, json = false;
};

std::uint32_t rung_of(const std::string& text) {
  if (text == "max") return kBestRung;
  if (text.empty() || text.size() > 3 || text.find_first_not_of("0123456789") != std::string::npos)
    throw UsageError("--rung", "", "a rung's number (texmesh dump PKG ladder lists them) or max", text);
  return static_cast<std::uint32_t>(std::stoul(text));
}

ExtractRequest request_of(const ExtractArguments& a) {
  ExtractRequest r;
  if (!a.bytes.empty()) {
    r.bytes = parse_bytes(a.bytes, "--bytes");
    if (r.bytes == 0) throw UsageError("--bytes", "", "a number above 0", a.bytes);
  }
  if (a.scale >= 0) r.scale = a.scale;
  r.rung = rung_of(a.rung);
  r.display_px = a.display_px;
  r.lods = a.lods;
  if (a.images == "jpeg") r.images = ExtractImages::kJpeg;
  if (a.images == "webp") r.images = ExtractImages::kWebp;
  if (a.images == "png") r.images = ExtractImages::kPng;
  return r;
}

}  // namespace

void add_extract_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<ExtractArguments>();
  CLI::App* c =
      app.add_subcommand("extract", "Write one GLB that any viewer opens: a scale with whole textures");
  c->add_option("package", args->package, "A .texmesh file, a folder that unpack made, or an http(s) URL")
      ->required();
  c->add_option("-o,--output", args->output, "The GLB to write")->required()->type_name("GLB");
  auto* bytes =
      c->add_option("--bytes", args->bytes,
                    "The best-looking file of at most so many bytes, and at least 98 % of them: 500kB, 2MB");
  c->add_option("--scale", args->scale, "This scale (texmesh dump lists them); default: what suits --display")
      ->check(CLI::Range(0, 99));
  c->add_option("--rung", args->rung, "Quality of the textures: a rung's number, 0 = lowest, or max")
      ->capture_default_str()
      ->excludes(bytes);
  c->add_option("--display", args->display_px,
                "Displayed height of the object, device pixels: chooses scale and size of the textures; with "
                "--bytes the size at which files are compared (default 512)")
      ->check(NumberIn(1, 1e6));
  c->add_option("--image-format", args->images,
                "auto = with --bytes whichever looks better, otherwise jpeg; png is lossless; images with "
                "alpha are png where jpeg is "
                "asked for")
      ->check(CLI::IsMember({"auto", "jpeg", "webp", "png"}))
      ->capture_default_str();
  c->add_flag(
      "--lods", args->lods,
      "All major scales from the chosen one on as levels of detail of one file (MSFT_lod), sharing textures");
  c->add_option("-j,--jobs", args->jobs, "Threads; 0 = one per processor")->check(CLI::Range(0, 1024));
  c->add_flag("--json", args->json, "What was chosen as one JSON object (schemas/extract.v1.schema.json)");
  c->footer(
      "With --bytes, scale, size of the textures and their quality are chosen together: candidates are "
      "rendered and\n"
      "compared with the package's best (FLIP), and the file is filled up to the last 2 %. Many triangles "
      "with a small\n"
      "texture nearly always look better than the reverse. Meshes stay Draco coded "
      "(KHR_draco_mesh_compression), WebP\n"
      "needs EXT_texture_webp; viewers without them can have --image-format jpeg and packages compiled with\n"
      "--mesh-codec none.\n"
      "Examples:\n"
      "  texmesh extract bust.texmesh --bytes 500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --scale 0 --rung max --image-format png -o master.glb\n"
      "  texmesh extract https://host/bust.texmesh --display 800 -o bust.glb\n"
      "  texmesh extract bust.texmesh --lods --bytes 2MB -o bust.glb\n"
      "Exit code: 0, 1 when the package is damaged or GLB cannot be written, 2 usage, 4 when the package "
      "cannot give\n"
      "a file within 2 % below --bytes: the nearest possible file is written then.");
  c->callback([args, &exit_code] {
    const ExtractRequest request = request_of(*args);
    check_output_file(args->output);  // not after the search
    RunContext context;
    context.threads =
        args->jobs > 0 ? args->jobs : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    PackageReader package(open_store(args->package));
    const Extracted extracted = extract_model(package, request, context);
    write_output_file(args->output, extracted.glb);
    const std::string file = std::filesystem::path(args->output).filename().string();
    std::cout << (args->json ? extract_json(extracted, request, file) + "\n"
                             : extract_text(extracted, request, file));
    exit_code = extracted.within ? kExitOk : kExitDifferent;
  });
}

}  // namespace texmesh
