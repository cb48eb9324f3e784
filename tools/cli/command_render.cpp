#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/record.h"
#include "stages/image/png_writer.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/painting.h"
#include "tools/extract/package_model.h"
#include "tools/inspect/package_mesh.h"
#include "tools/publish/pages/page.h"
#include "tools/render/picture_sheet.h"

namespace texmesh {
namespace {

struct RenderArguments {
  std::string input, output, rung, environment = "studio";
  int views = 1, size_px = 512, scale = -1, jobs = 0;
  bool unlit = false, json = false;
  Painting painting;  // of --what
};

void check_usage(const RenderArguments& args) {
  if (!args.output.ends_with(".png") && !args.output.ends_with(".PNG"))
    throw UsageError("--output", "", "a name that ends in .png", args.output);
  const std::uint32_t columns = sheet_columns(args.views);
  if (static_cast<std::uint32_t>(args.size_px) > kMaxSheetSide / columns)
    throw UsageError("--size", "",
                     fmt::format("at most {} px with {} views: a sheet has at most {} px a side",
                                 kMaxSheetSide / columns, args.views, kMaxSheetSide),
                     std::to_string(args.size_px));
}

PackageChoice choice_of(const RenderArguments& args) {
  PackageChoice choice;
  if (args.scale >= 0) choice.scale = args.scale;
  if (args.rung.empty() || args.rung == "max") return choice;
  if (args.rung == "preview")
    choice.textures = PackageTextures::kPreview;
  else if (args.rung == "source")
    choice.textures = PackageTextures::kSource;
  else if (args.rung.size() <= 3 && args.rung.find_first_not_of("0123456789") == std::string::npos)
    choice.rung = static_cast<std::uint32_t>(std::stoul(args.rung));
  else
    throw UsageError("--rung", "",
                     "a rung's number (texmesh dump PKG ladder lists them), max, source or preview",
                     args.rung);
  return choice;
}

RenderedModel model_of(const RenderArguments& args, const RunContext& context) {
  const PackageChoice choice = choice_of(args);
  if (is_package(args.input)) {
    PackageReader package(open_store(args.input));
    return package_model(package, choice, context);
  }
  for (const auto& [flag, given] : {std::pair{"--scale", args.scale >= 0}, {"--rung", !args.rung.empty()}})
    if (given && std::filesystem::exists(args.input))
      throw UsageError(flag, "", "a package, whose scales and rungs can be chosen", args.input);
  return load_rendered_model(args.input, {}, context);
}

std::array<double, 3> numbers(Vec3d v) { return {v.x, v.y, v.z}; }

/// A view of the sheet; `origin` leads from the mesh's frame to the source's.
struct PrintedView {
  SheetView view;
  Vec3d origin;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("left_px", s.view.left_px, "");
    v("top_px", s.view.top_px, "");
    v("covered_px", s.view.covered_px, "");
    v("eye", numbers(s.view.camera.eye + s.origin), "");
    v("right", numbers(s.view.camera.x), "");
    v("up", numbers(s.view.camera.y), "");
    v("backwards", numbers(s.view.camera.z), "");
    v("tan_half_fov", s.view.camera.tan_half_fov, "");
    v("near", s.view.camera.near, "");
  }
};

struct PrintedTexture {
  std::uint32_t width_px = 0, height_px = 0;
  bool colours = false;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("width_px", s.width_px, "");
    v("height_px", s.height_px, "");
    v("colours", s.colours, "");
  }
};

/// What --json prints.
struct RenderDocument {
  const RenderArguments& args;
  const RenderedModel& model;
  const Pixels& pixels;
  std::vector<PrintedTexture> textures = {};
  std::vector<PrintedView> views = {};
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("file", last_name(s.args.output), "");
    v("width_px", s.pixels.width_px, "");
    v("height_px", s.pixels.height_px, "");
    v("view_px", s.args.size_px, "");
    v("environment", s.args.environment, "");
    v("unlit", s.args.unlit, "");
    v("triangles", s.model.mesh.triangles.size(), "");
    v("materials", s.model.materials.size(), "");
    v("textures", s.textures, "");
    v("views", s.views, "");
    v("notes", s.model.notes, "");
  }
};

void print_render_json(const RenderArguments& args, const RenderedModel& model, const PictureSheet& sheet) {
  RenderDocument document{args, model, sheet.pixels};
  for (std::size_t t = 0; t < model.textures.size(); ++t)
    document.textures.push_back(
        {model.textures[t].width_px, model.textures[t].height_px, model.texture_images[t].srgb});
  for (const SheetView& view : sheet.views) document.views.push_back({view, model.mesh.origin});
  std::cout << to_json_line(document) << '\n';
}

void print_render_text(const RenderArguments& args, const RenderedModel& model, const PictureSheet& sheet) {
  double covered = 0;
  for (const SheetView& v : sheet.views) covered += v.covered_px;
  const double pixels = static_cast<double>(sheet.views.size()) * args.size_px * args.size_px;
  const auto counted = [](std::size_t n, const char* word) {
    return fmt::format("{} {}{}", n, word, n == 1 ? "" : "s");
  };
  std::cout << fmt::format("{}: {}, {}, {} of {} px, {:.1f} % covered\n", last_name(args.output),
                           counted(model.mesh.triangles.size(), "triangle"),
                           counted(model.textures.size(), "texture"), counted(sheet.views.size(), "view"),
                           args.size_px, 100 * covered / pixels);
  for (const Note& n : model.notes)
    if (n.severity == Severity::kWarning)
      std::cerr << "warning: " << n.code << (n.place.empty() ? "" : ": " + n.place) << ": " << n.text << '\n';
}

bool wholly_transparent(const RenderedModel& model) {
  return std::ranges::all_of(model.mesh.triangle_material, [&](std::uint32_t m) {
    const RenderMaterial& material = model.materials[m];
    return material.alpha_mode != AlphaMode::kOpaque && material.base_colour.w <= 0;
  });
}

void note_empty_picture(const PictureSheet& sheet, RenderedModel& model) {
  if (std::ranges::any_of(sheet.views, [](const SheetView& v) { return v.covered_px > 0; })) return;
  add_warning(
      model.notes, "empty-picture", "",
      wholly_transparent(model)
          ? "the picture is empty, because every material of the model is wholly transparent (alpha 0)"
          : "the picture is empty, because no view sees anything of the model: its surface is "
            "transparent there, turned away, or smaller than a pixel's samples");
}

/// Options of pictures as viewers show them mean nothing for what stages computed.
int run_what(const RenderArguments& args) {
  for (const auto& [flag, given] : {std::pair{"--views", args.views != 1},
                                    {"--scale", args.scale >= 0},
                                    {"--rung", !args.rung.empty()},
                                    {"--unlit", args.unlit}})
    if (given) throw UsageError(flag, "", "no --what", args.painting.what);
  if (args.size_px < 64 || args.size_px > 4096)
    throw UsageError("--size", "", "64 to 4096 px, with --what", std::to_string(args.size_px));
  Painting painting = args.painting;
  painting.input = args.input, painting.output = args.output, painting.jobs = args.jobs;
  painting.size_px = args.size_px, painting.json = args.json;
  return run_painting(painting, painted_quantities());
}

int run_render(const RenderArguments& args) {
  if (!args.painting.what.empty()) return run_what(args);
  check_usage(args);
  check_output_file(args.output);  // not after the work
  const RunContext context = context_of(args.jobs);
  RenderedModel model = model_of(args, context);
  if (args.unlit) make_unlit(model);
  const RenderEnvironment environment =
      environment_of(args.environment == "white" ? RenderLight::kWhite : RenderLight::kStudio, context);
  const PictureSheet sheet =
      render_sheet(model, environment, args.views, static_cast<std::uint32_t>(args.size_px), context);
  note_empty_picture(sheet, model);
  write_output_file(args.output, write_png(sheet.pixels));
  if (args.json)
    print_render_json(args, model, sheet);
  else
    print_render_text(args, model, sheet);
  return kExitOk;
}

void add_render_options(Command& c, RenderArguments& args) {
  c.option("INPUT", args.input,
           "A model that compile takes (glTF, GLB, OBJ, PLY, STL, range scan), or a package: a .texmesh file "
           "or a "
           "folder that unpack made")
      .required();
  c.option("-o,--output", args.output,
           "The picture to write, x.png; with --what also x.glb, to turn in any viewer")
      .required()
      .value_name("FILE");
  c.option(
       "--views", args.views,
       "Views, which become one sheet, row by row: directions spread evenly over the sphere. A single one "
       "shows the front from its right, a little from above")
      .integer_in(1, kMaxSheetViews)
      .shows_default();
  c.option("--size", args.size_px, "Side of one view, px")
      .integer_in(1, 8192)
      .value_name("PX")
      .shows_default();
  c.option("--scale", args.scale,
           "Of a package: this scale (texmesh dump lists the scales). Default: 0, the finest. All scales are "
           "seen "
           "by the same cameras")
      .integer_in(0, 99);
  c.option(
       "--rung", args.rung,
       "Of a package: quality of the textures. A rung's number, 0 = lowest, textures with fewer rungs show "
       "their best; max = the best of each (default); source = the source images where the package keeps "
       "them; preview = those of the first picture")
      .value_name("RUNG");
  c.option(
       "--environment", args.environment,
       "studio = the light of all measurements: soft boxes and one key light. white = the same light from "
       "everywhere, which shows what materials swallow")
      .one_of_explained({"studio", "white"})
      .value_name("LIGHT")
      .shows_default();
  c.flag("--unlit", args.unlit, "Base colours alone, without any light");
  add_jobs_option(c, args.jobs);
  c.flag(
      "--json", args.json,
      "Print cameras, covered pixels, triangles, textures and notes as one JSON object; with --what the legend");
  c.group("What stages computed, in two views side by side, with a legend");
  std::vector<std::string> names;
  for (const PaintedQuantity& q : painted_quantities()) names.emplace_back(q.name);
  c.option(
       "--what", args.painting.what,
       "atlas: the charts of the textures, thin ones red, overlaps magenta, and the textures themselves. "
       "fragments: the texture's grid, and which fragments come first. scales: up to which scale a vertex stays "
       "a feature (of models alone)")
      .one_of_explained(names)
      .value_name("QUANTITY");
  add_painting_options(c, args.painting);
}

}  // namespace

void add_render_command(Command& app) {
  auto args = std::make_shared<RenderArguments>();
  Command c = app.add("render", "Picture a model or a package as viewers show it, lit");
  add_render_options(c, *args);
  c.examples(
      "  texmesh render bust.glb -o bust.png\n"
      "  texmesh render bust.texmesh --scale 14 --rung 2 --size 256 -o coarse.png\n"
      "  texmesh render bust.texmesh --views 9 -o sheet.png\n"
      "  texmesh render bust.texmesh --unlit --rung preview -o colours.png\n"
      "  texmesh render bust.glb --what atlas -o atlas.png\n"
      "  texmesh render bust.texmesh --what fragments -o grid.glb --json");
  c.notes(
      "The reference renderer shows glTF's metallic-roughness materials with normal maps, occlusion, "
      "emission, alpha and vertex colours, in perspective, tone-mapped (Khronos PBR Neutral), 16 samples a "
      "pixel. Other extensions of materials are not rendered; a warning names them.\n"
      "--what: colours run from dark violet (low) over teal to yellow (high); the legend on standard output gives "
      "their values. A GLB holds the colours as vertex colours, those of fragments and atlas as textures. For a "
      "model, render runs the stages that it needs, through the cache.\n"
      "The same input gives the same bytes on every machine.\n"
      "Exit code: 0, 1 when the input cannot be shown or the picture not be written, 2 usage, 3 internal "
      "error.");
  c.on_run([args] { return run_render(*args); });
}

}  // namespace texmesh
