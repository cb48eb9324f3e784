#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include "format/container/layout.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/percent_line.h"
#include "tools/cli/options/units.h"
#include "tools/extract/extract.h"

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

/// A number of bytes, as the user wrote it.
struct AskedBytes {
  std::string text;
  std::uint64_t bytes = 0;
};

std::vector<AskedBytes> asked_bytes(const std::string& list) {
  std::vector<AskedBytes> out;
  for (std::size_t at = 0; at <= list.size() && !list.empty();) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    AskedBytes one{list.substr(at, end - at), 0};
    one.bytes = parse_bytes(one.text, "--bytes");
    if (one.bytes == 0) throw UsageError("--bytes", "", "numbers above 0", list);
    if (std::ranges::find(out, one.text, &AskedBytes::text) != out.end())
      throw UsageError("--bytes", "", "every number once", list);
    out.push_back(std::move(one));
    at = end + 1;
  }
  return out;
}

/// bust.glb becomes bust-50kB.glb.
std::string output_for(const std::string& output, const AskedBytes& asked) {
  std::filesystem::path path(output);
  const std::string ending = path.extension().string();
  path.replace_extension();
  return path.string() + "-" + asked.text + ending;
}

ExtractRequest request_of(const ExtractArguments& a) {
  ExtractRequest r;
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

void write_extracted(const ExtractArguments& args, const Extracted& extracted, const ExtractRequest& request,
                     const std::string& output) {
  write_output_file(output, extracted.glb);
  const std::string file = std::filesystem::path(output).filename().string();
  std::cout << (args.json ? extract_json(extracted, request, file) + "\n"
                          : extract_text(extracted, request, file));
}

int run_extract(const ExtractArguments& args) {
  ExtractRequest request = request_of(args);
  const std::vector<AskedBytes> asked = asked_bytes(args.bytes);
  std::vector<std::string> outputs;
  std::vector<std::uint64_t> bytes;
  for (const AskedBytes& one : asked) {
    outputs.push_back(asked.size() > 1 ? output_for(args.output, one) : args.output);
    bytes.push_back(one.bytes);
  }
  if (asked.empty()) outputs.push_back(args.output);
  for (const std::string& output : outputs) check_output_file(output);  // not after the search
  PackageReader package(open_store(args.package));
  PercentLine progress("extract");
  RunContext context = context_of(args.jobs);
  context.progress = [&](double fraction) { progress.show(fraction); };
  const std::vector<Extracted> files = asked.empty()
                                           ? std::vector<Extracted>{extract_model(package, request, context)}
                                           : extract_budgets(package, request, bytes, context);
  progress.end();
  bool within = true;
  for (std::size_t k = 0; k < files.size(); ++k) {
    if (!asked.empty()) request.bytes = bytes[k];
    write_extracted(args, files[k], request, outputs[k]);
    within = within && files[k].within;
  }
  return within ? kExitOk : kExitDifferent;
}

void add_extract_options(Command& c, ExtractArguments& args) {
  add_package_argument(c, args.package, true);
  c.option("-o,--output", args.output, "The GLB to write").required().value_name("GLB");
  const Option bytes =
      c.option("--bytes", args.bytes,
               "The best-looking file of at most so many bytes, and at least 98 % of them: 500kB, 2MB. "
               "Several (50kB,500kB) give a file each, bust-50kB.glb and bust-500kB.glb for -o bust.glb, and "
               "share the search")
          .value_name("SIZE[,SIZE...]");
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
  c.flag(
      "--json", args.json,
      "Print what was chosen as one JSON object for each file, a line each (schemas/extract.v1.schema.json)");
}

}  // namespace

void add_extract_command(Command& app) {
  auto args = std::make_shared<ExtractArguments>();
  Command c = app.add("extract");
  add_extract_options(c, *args);
  c.examples(
      "  texmesh extract bust.texmesh --bytes 500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --bytes 50kB,100kB,500kB -o bust.glb\n"
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
