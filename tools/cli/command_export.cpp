#include <algorithm>
#include <filesystem>

#include "format/documents/about.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/percent_line.h"
#include "tools/cli/options/units.h"
#include "tools/publish/export/export.h"
#include "tools/publish/view/served_files.h"

namespace texmesh {
namespace {

struct ExportArguments {
  std::string package, folder, viewer;
  ExportOptions options;
  int width_px = 640, height_px = 480, jobs = 0;
  bool json = false;
};

/// Options that mean nothing for the target are a mistake of the user's.
void check_for_target(const ExportOptions& o) {
  const auto refuse = [&](const char* option, const char* instead) {
    throw UsageError(option, "", instead, "--to " + std::string(enum_name(o.target)));
  };
  const bool one_glb = o.target == ExportTarget::kGltfLod || o.target == ExportTarget::kModelViewer;
  if (o.bytes > 0 && !one_glb) refuse("--bytes", "--to gltf-lod or model-viewer");
  if (o.plain && (o.target == ExportTarget::kGltfLod || o.target == ExportTarget::kOembed))
    refuse("--plain", "--to 3dtiles or model-viewer");
  if (o.plain && o.bytes > 0) throw UsageError("--plain", "", "no --bytes", std::to_string(o.bytes));
  if (o.display_px > 0 && o.target == ExportTarget::kOembed)
    refuse("--display", "a target that holds a model");
  if (o.target == ExportTarget::kOembed) {
    if (!is_web_url(o.url))
      throw UsageError("--url", "", "the http or https URL of the folder, for --to oembed", o.url);
  } else if (!o.url.empty() || !o.provider.empty()) {
    refuse(o.url.empty() ? "--provider" : "--url", "--to oembed");
  }
  if (!o.script.empty() && o.target != ExportTarget::kModelViewer) refuse("--script", "--to model-viewer");
}

ExportOptions export_options_of(const ExportArguments& a) {
  ExportOptions o = a.options;
  o.width_px = static_cast<std::uint32_t>(a.width_px);
  o.height_px = static_cast<std::uint32_t>(a.height_px);
  check_for_target(o);
  if (!o.url.empty() && !o.url.ends_with("/")) o.url += "/";
  if (o.target == ExportTarget::kOembed) o.viewer = viewer_folder(a.viewer);
  return o;
}

int run_export(const ExportArguments& args) {
  const ExportOptions options = export_options_of(args);
  check_export_folder(args.folder);  // not after the work
  PackageReader package(open_store(args.package));
  PercentLine progress("export");
  RunContext context = context_of(args.jobs);
  context.progress = [&](double fraction) { progress.show(fraction); };
  const Export made = make_export(package, args.package, options, context);
  progress.end();
  write_export(made, args.folder);
  if (args.json) {
    std::cout << export_json(made);
  } else {
    std::cout << (std::filesystem::path(args.folder) / made.open).string() << '\n';
    for (const std::string& note : made.notes) std::cout << "note: " << note << '\n';
  }
  return kExitOk;
}

void add_target_options(Command& c, ExportArguments& args) {
  c.choice("--to", args.options.target,
           "The form: 3dtiles = a tileset of 3D Tiles 1.1 for CesiumJS and its like; gltf-lod = one GLB with "
           "levels of detail (MSFT_lod); model-viewer = a page with <model-viewer>; oembed = a frame for "
           "other pages and the oEmbed answer that tells of it")
      .required()
      .value_name("TARGET");
  c.option("-o,--output", args.folder,
           "The folder to make. An earlier export is replaced; any other folder with files is refused")
      .required()
      .value_name("DIR");
  c.option("--display", args.options.display_px,
           "Nothing finer than what this displayed height of the object needs, device px; default: "
           "everything, for model-viewer 1000")
      .number_in(1, 1e6)
      .value_name("PX");
  c.option("--bytes", args.options.bytes, parse_some_bytes,
           "gltf-lod, model-viewer: the best-looking GLB of at most so many bytes: 2MB")
      .value_name("SIZE");
  c.flag("--plain", args.options.plain,
         "3dtiles, model-viewer: meshes as floats, for viewers without a decoder of Draco");
  c.option("--screen-error", args.options.screen_error_px,
           "3dtiles: the error at which the viewer takes the next level, its maximumScreenSpaceError or "
           "errorTarget, px")
      .number_in(0.1, 1000)
      .shows_default()
      .value_name("PX");
  c.option("--script", args.options.script,
           "model-viewer: URL of its script, as the page names it; default: a version of it from jsDelivr, "
           "with its digest")
      .value_name("URL");
}

void add_oembed_options(Command& c, ExportArguments& args) {
  c.option("--url", args.options.url, "oembed: where the folder will stand on the web").value_name("URL");
  c.option("--provider", args.options.provider, "oembed: name of the publisher; default: the host of --url")
      .value_name("NAME");
  c.option("--width", args.width_px, "oembed: width of the frame, px").integer_in(64, 8192).shows_default();
  c.option("--height", args.height_px, "oembed: height of the frame, px")
      .integer_in(64, 8192)
      .shows_default();
  c.option("--viewer", args.viewer,
           "oembed: folder with the built viewer, instead of the viewer of this build")
      .value_name("DIR");
}

}  // namespace

void add_export_command(Command& app) {
  auto args = std::make_shared<ExportArguments>();
  Command c = app.add(
      "export", "Write a package in the form of another viewer: 3D Tiles, MSFT_lod, model-viewer, oEmbed");
  add_package_argument(c, args->package, true).required();
  add_target_options(c, *args);
  add_oembed_options(c, *args);
  add_jobs_option(c, args->jobs);
  c.flag("--json", args->json, "Print one JSON object (schemas/export.v1.schema.json)");
  c.examples(
      "  texmesh export bust.texmesh --to 3dtiles -o tiles/\n"
      "  texmesh export bust.texmesh --to gltf-lod --bytes 2MB -o bust-lod/\n"
      "  texmesh export bust.texmesh --to model-viewer --display 800 -o page/\n"
      "  texmesh export bust.texmesh --to oembed --url https://museum.example/bust/ -o bust/");
  c.notes(
      "3dtiles: each level is the output of texmesh extract --display for 4096, 2048, ... 32 px. The "
      "coarsest level is outermost. Levels that save less than a quarter of the bytes are left out. A "
      "viewer whose limit is --screen-error takes the next level at that height. Where the unit is known "
      "(texmesh dump PKG about) tiles are in metres, else in the "
      "object's unit. The object stands where its source has it; nothing puts it on the globe.\n"
      "gltf-lod: all major scales from the finest on; levels share materials and textures.\n"
      "model-viewer: index.html, model.glb and the poster. Draco meshes make the script fetch a decoder from "
      "gstatic.com; with --plain it needs none.\n"
      "oembed: a copy of the package, the viewer and oembed.json, to be put at --url. If a URL names "
      "the package, the package stays there.\n"
      "export.json in the folder lists what was written. The same package gives the same files.\n"
      "Exit code: 0, 1 when the package is damaged, the target cannot hold it (the message says why) or DIR "
      "cannot be written, 2 usage.");
  c.on_run([args] { return run_export(*args); });
}

}  // namespace texmesh
