#include <filesystem>
#include <iostream>
#include <memory>

#include "format/container/layout.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/cli/options/common_options.h"
#include "pipeline/cli/options/units.h"
#include "pipeline/extract/extract.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

struct ExtractArguments {
  std::string package, output, bytes, rung = "max", images = "auto";
  int scale = -1, proxy = -1, jobs = 0;
  double display_px = 0;
  bool recentre = false, lods = false, plain = false, json = false;
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
  if (a.proxy >= 0) r.proxy = static_cast<std::uint32_t>(a.proxy);
  r.rung = rung_of(a.rung);
  r.display_px = a.display_px;
  r.recentre = a.recentre;
  r.lods = a.lods;
  r.plain = a.plain;
  if (a.plain && a.images == "webp") throw UsageError("--plain", "", "--image-format jpeg or png", "webp");
  if (a.images == "jpeg") r.images = ExtractImages::kJpeg;
  if (a.images == "webp") r.images = ExtractImages::kWebp;
  if (a.images == "png") r.images = ExtractImages::kPng;
  return r;
}

int run_extract(const ExtractArguments& args) {
  const ExtractRequest request = request_of(args);
  check_output_file(args.output);  // not after the search
  PackageReader package(open_store(args.package));
  const Extracted extracted = extract_model(package, request, context_of(args.jobs));
  write_output_file(args.output, extracted.glb);
  const std::string file = std::filesystem::path(args.output).filename().string();
  std::cout << (args.json ? extract_json(extracted, request, file) + "\n"
                          : extract_text(extracted, request, file));
  return extracted.within ? kExitOk : kExitDifferent;
}

void add_extract_options(Command& c, ExtractArguments& args) {
  add_package_argument(c, args.package, true);
  c.option("-o,--output", args.output, "The GLB to write").required().value_name("GLB");
  const Option bytes =
      c.option("--bytes", args.bytes,
               "The best-looking file of at most so many bytes, and at least 98 % of them: 500kB, 2MB")
          .value_name("SIZE");
  const Option scale =
      c.option("--scale", args.scale,
               "This scale (texmesh dump lists the scales); default: the scale that suits --display")
          .integer_in(0, 99);
  c.option("--proxy", args.proxy,
           "This proxy, a small file with an atlas of its own (texmesh dump lists them), as it is: 0 = the "
           "smallest")
      .integer_in(0, kMaxPackageProxies - 1)
      .excludes(bytes)
      .excludes(scale);
  c.option("--rung", args.rung, "Quality of the textures: a rung's number, 0 = lowest, or max")
      .shows_default()
      .value_name("RUNG")
      .excludes(bytes);
  c.option(
       "--display", args.display_px,
       "Displayed height of the object, device pixels. It chooses the scale and the size of the textures; "
       "with --bytes files are compared at it (default 512)")
      .number_in(1, 1e6)
      .value_name("PX");
  c.option(
       "--image-format", args.images,
       "auto = with --bytes the format that looks better, otherwise jpeg. png is without loss. Images with "
       "alpha are png where jpeg is asked for")
      .one_of({"auto", "jpeg", "webp", "png"})
      .value_name("FORMAT")
      .shows_default();
  const Option lods = c.flag(
      "--lods", args.lods,
      "All major scales from the chosen one on as levels of detail of one file (MSFT_lod), which share "
      "textures");
  c.flag(
       "--plain", args.plain,
       "Meshes as floats and images as JPEG or PNG, without extensions that compress: for programs that read "
       "glTF 2.0 alone, such as Debian 12's Blender and F3D")
      .excludes(bytes)
      .excludes(lods);
  c.flag("--recentre", args.recentre,
         "Leave the model near 0, in the frame of the package's meshes; default: where the source has it");
  add_jobs_option(c, args.jobs);
  c.flag("--json", args.json, "Print what was chosen as one JSON object (schemas/extract.v1.schema.json)");
}

}  // namespace

void add_extract_command(Command& app) {
  auto args = std::make_shared<ExtractArguments>();
  Command c = app.add("extract");
  add_extract_options(c, *args);
  c.examples(
      "  texmesh extract bust.texmesh --bytes 500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --scale 0 --rung max --image-format png -o master.glb\n"
      "  texmesh extract https://host/bust.texmesh --display 800 -o bust.glb\n"
      "  texmesh extract bust.texmesh --lods --bytes 2MB -o bust.glb");
  c.notes(
      "--bytes chooses scale, size of the textures and their quality together: candidates are rendered lit, "
      "as texmesh render does, and compared with the package's best (FLIP). Colours, normals, roughness and "
      "the other maps get bytes for what they change in the picture, and the file is filled up to the last "
      "2 %. A proxy of the package, made smaller where it has to be, is taken where it looks better. Many triangles with a small texture nearly always look better than the reverse.\n"
      "Meshes stay Draco coded (KHR_draco_mesh_compression), a whole proxy's is coded by meshopt "
      "(EXT_meshopt_compression), and WebP needs EXT_texture_webp. For programs without them use --plain.\n"
      "Exit code: 0, 1 when the package is damaged or the GLB cannot be written, 2 usage, 4 when the "
      "package cannot give a file within 2 % below --bytes (extract writes the nearest possible file then), "
      "unless the file has all that the package holds of a source of JPEGs.");
  c.on_run([args] { return run_extract(*args); });
}

}  // namespace texmesh
