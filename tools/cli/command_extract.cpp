#include <filesystem>

#include "format/container/layout.h"
#include "pipeline/io/atomic_file.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/percent_line.h"
#include "tools/cli/options/units.h"
#include "tools/extract/extract.h"

namespace texmesh {
namespace {

/// A number of bytes, as the user wrote it.
struct AskedBytes {
  std::string text;
  std::uint64_t bytes = 0;
};

struct ExtractArguments {
  std::string package, output;
  std::vector<AskedBytes> bytes;
  std::uint32_t rung = kBestRung;
  ExtractImages images = ExtractImages::kAuto;
  std::optional<int> scale, proxy;
  double display_px = 0;
  int jobs = 0;
  bool recentre = false, levels = false, plain = false, json = false;
};

std::uint32_t rung_of(const std::string& text, const std::string& flag) {
  if (text == "max") return kBestRung;
  if (text.empty() || text.size() > 3 || text.find_first_not_of("0123456789") != std::string::npos)
    throw UsageError(flag, "", "a rung's number (texmesh dump PKG ladder lists them) or max", text);
  return static_cast<std::uint32_t>(std::stoul(text));
}

std::vector<AskedBytes> asked_bytes(const std::string& list, const std::string& flag) {
  std::vector<AskedBytes> out;
  for (std::size_t at = 0; at <= list.size() && !list.empty();) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    AskedBytes one{list.substr(at, end - at), 0};
    one.bytes = parse_some_bytes(one.text, flag);
    if (std::ranges::find(out, one.text, &AskedBytes::text) != out.end())
      throw UsageError(flag, "", "every number once", list);
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
  if (a.plain && a.images == ExtractImages::kWebp)
    throw UsageError("--plain", "", "--image-format jpeg or png", "webp");
  if (a.proxy) return {ExtractProxy{static_cast<std::uint32_t>(*a.proxy), a.plain}, a.recentre};
  if (a.bytes.empty()) {
    const auto form = a.plain    ? ExtractScale::Form::kPlain
                      : a.levels ? ExtractScale::Form::kLevels
                                 : ExtractScale::Form::kCoded;
    return {ExtractScale{a.scale, a.rung, a.display_px, a.images, form}, a.recentre};
  }
  ExtractBudget budget;
  for (const AskedBytes& one : a.bytes) budget.bytes.push_back(one.bytes);
  budget.scale = a.scale;
  if (a.display_px > 0) budget.display_px = a.display_px;
  budget.images = a.images;
  budget.levels = a.levels;
  return {budget, a.recentre};
}

void write_extracted(const ExtractArguments& args, const Extracted& extracted, const std::string& output) {
  write_output_file(output, extracted.glb);
  const std::string file = std::filesystem::path(output).filename().string();
  std::cout << (args.json ? extract_json(extracted, file) + "\n" : extract_text(extracted, file));
}

int run_extract(const ExtractArguments& args) {
  const ExtractRequest request = request_of(args);
  std::vector<std::string> outputs;
  for (const AskedBytes& one : args.bytes)
    outputs.push_back(args.bytes.size() > 1 ? output_for(args.output, one) : args.output);
  if (outputs.empty()) outputs.push_back(args.output);
  for (const std::string& output : outputs) check_output_file(output);  // not after the search
  PackageReader package(open_store(args.package));
  PercentLine progress("extract");
  RunContext context = context_of(args.jobs);
  context.progress = [&](double fraction) { progress.show(fraction); };
  const std::vector<Extracted> files = extract_files(package, request, context);
  progress.end();
  bool within = true;
  for (std::size_t k = 0; k < files.size(); ++k) {
    write_extracted(args, files[k], outputs[k]);
    within = within && files[k].within;
  }
  return within ? kExitOk : kExitDifferent;
}

void add_extract_options(Command& c, ExtractArguments& args) {
  add_package_argument(c, args.package, true);
  c.option("-o,--output", args.output, "The GLB to write").required().value_name("GLB");
  const Option bytes =
      c.option("--bytes", args.bytes, asked_bytes,
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
  c.option("--rung", args.rung, rung_of, "Quality of the textures: a rung's number, 0 = lowest, or max")
      .shows_default("max")
      .value_name("RUNG")
      .excludes(bytes);
  c.option(
       "--display", args.display_px,
       "Displayed height of the object, device pixels. It chooses the scale and the size of the textures; "
       "with --bytes files are compared at it (default 512)")
      .number_in(1, 1e6)
      .value_name("PX");
  c.choice(
       "--image-format", args.images,
       "auto = with --bytes the format that looks better, otherwise jpeg. png is without loss. Images with "
       "alpha are png where jpeg is asked for")
      .lists_words()
      .value_name("FORMAT")
      .shows_default();
  const Option lods = c.flag(
      "--lods", args.levels,
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
  Command c = app.add("extract", "Write one GLB that any viewer opens: a scale with whole textures");
  add_extract_options(c, *args);
  c.examples(
      "  texmesh extract bust.texmesh --bytes 500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --bytes 50kB,100kB,500kB -o bust.glb\n"
      "  texmesh extract bust.texmesh --scale 0 --rung max --image-format png -o master.glb\n"
      "  texmesh extract https://host/bust.texmesh --display 800 -o bust.glb\n"
      "  texmesh extract bust.texmesh --lods --bytes 2MB -o bust.glb");
  c.notes(
      "--bytes chooses the scale and the size and quality of the textures together. It renders candidates "
      "lit, as texmesh render does, and compares them with the package's best (FLIP). Maps that change the "
      "picture more get more bytes, and the file is filled up to the last 2 %. If a proxy looks better, "
      "extract takes it, and makes it smaller if needed. Many triangles with a small texture nearly always "
      "look better than the reverse.\n"
      "Meshes of scales stay coded by Draco (KHR_draco_mesh_compression), those of whole proxies by meshopt "
      "(EXT_meshopt_compression). WebP needs EXT_texture_webp. For programs without these use --plain.\n"
      "Exit code: 0, 1 when the package is damaged or the GLB cannot be written, 2 usage, 4 when no file "
      "between 98 % and 100 % of --bytes is possible: extract then writes the nearest file. A file that "
      "already holds everything in a package of JPEG sources is no failure.");
  c.on_run([args] { return run_extract(*args); });
}

}  // namespace texmesh
