// The commands that look into packages, and the two that take a package apart and put it together again.
#include <fmt/format.h>
#include <sys/resource.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "stages/image/png_writer.h"
#include "tools/cli/check/check_gate.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/painting.h"
#include "tools/extract/package_model.h"
#include "tools/inspect/diff/diff.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/package_mesh.h"
#include "tools/inspect/package_tree.h"
#include "tools/inspect/verify/verify.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

struct DumpArguments {
  std::string package;
  DumpPart part = DumpPart::kSummary;
  std::optional<double> gamma;
  bool json = false;
};

int run_dump(const DumpArguments& args) {
  if (args.gamma && args.part != DumpPart::kTables && args.part != DumpPart::kAll)
    throw UsageError("--gamma", "", "the part tables or all", std::string(enum_name(args.part)));
  PackageReader package(open_store(args.package));
  if (args.json)
    std::cout << dump_json(package, args.part, args.gamma).dump() << '\n';
  else
    std::cout << dump_text(package, args.part, args.gamma);
  return kExitOk;
}

struct VerifyArguments {
  std::vector<std::string> packages;
  int jobs = 0;
  std::uint64_t memory_mib = 8192;
  bool json = false, quiet = false;
};

/// Mesh decoders trust counts in the data; a package from a stranger must not take the whole machine.
/// Sanitizers reserve more address space than any limit allows.
void limit_memory(std::uint64_t mib) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  rlimit limit{};
  if (mib == 0 || ::getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, static_cast<rlim_t>(mib) << 20);
  ::setrlimit(RLIMIT_AS, &limit);
#else
  (void)mib;
#endif
}

/// A package that cannot be opened is a finding of its own: the other packages are checked all the same.
VerifyReport verify_path(const std::string& path, const RunContext& context) {
  try {
    const auto store = open_store(path);
    return verify_package(*store, context);
  } catch (const Error& e) {
    VerifyReport report;
    report.findings.push_back({"readable", rule_of(e), "", e.place(), e.expected(), e.found()});
    return report;
  }
}

void print_verified(const std::string& path, const VerifyReport& r, bool quiet) {
  const std::string name = printable(path);
  for (const Finding& f : r.findings) std::cout << name << ": " << printable(to_string(f)) << '\n';
  if (quiet && r.findings.empty()) return;
  std::cout << name << ": " << (r.findings.empty() ? "ok" : counted(r.findings.size(), "finding")) << " ("
            << r.entries << " entries, " << grouped(r.bytes) << " bytes, " << r.meshes << " meshes, "
            << r.previews << " previews, " << r.fragments << " fragments"
            << (r.notes ? "; notes: " + notes_words(*r.notes) : "")
            << (r.content_credential ? "; the content credential was not checked" : "") << ")\n";
}

int run_verify(const VerifyArguments& args) {
  limit_memory(args.memory_mib);
  const RunContext context = context_of(args.jobs);
  bool clean = true;
  std::vector<VerifiedPackage> all;
  for (const std::string& path : args.packages) {
    const VerifyReport report = verify_path(path, context);
    clean = clean && report.findings.empty();
    if (args.json)
      all.push_back({path, report});
    else
      print_verified(path, report, args.quiet);
  }
  if (args.json) std::cout << to_json_line(VerifiedPackages{all}) << '\n';
  return clean ? kExitOk : kExitModelFailed;
}

struct DiffArguments {
  std::array<std::string, 2> packages;
  bool json = false;
};

int run_diff(const DiffArguments& args) {
  PackageReader a(open_store(args.packages[0])), b(open_store(args.packages[1]));
  const PackageDiff diff = diff_packages(a, b, args.packages);
  std::cout << (args.json ? to_json_line(diff) + '\n' : diff_text(diff));
  return diff.equal() ? kExitOk : kExitDifferent;
}

struct UnpackArguments {
  std::string package, folder, fragments = "packs";
  bool force = false;
};

int run_unpack(const UnpackArguments& args) {
  check_folder_name(args.folder);
  unpack_package(args.package, args.folder, {args.fragments == "files", args.force});
  return kExitOk;
}

struct PackArguments {
  std::string folder, package;
};

int run_pack(const PackArguments& args) {
  if (!args.package.ends_with(".texmesh"))
    throw UsageError("--output", "", "a name that ends in .texmesh", args.package);
  pack_folder(args.folder, args.package);
  return kExitOk;
}

struct DoctorArguments {
  std::string input, junit;
  AtlasLimits limits;
  int jobs = 0;
  bool json = false;
};

AtlasDiagnosis diagnose_input(const std::string& path, std::optional<NotesCount>& notes,
                              const RunContext& context) {
  if (!is_package(path)) {
    const auto subject = atlas_subject(path, context);
    print_warnings(subject.notes);
    return diagnose_atlases(subject, context);
  }
  PackageReader package(open_store(path));
  if (package.manifest().annotations) notes = count_notes(package.annotations(), package.manifest());
  return diagnose_atlases(atlas_subject(package, context), context);
}

int run_doctor(const DoctorArguments& args) {
  std::optional<NotesCount> notes;
  const AtlasDiagnosis diagnosis = diagnose_input(args.input, notes, context_of(args.jobs));
  const std::vector<GateResult> results = check_atlases(diagnosis, args.limits);
  write_gate_junit(args.junit, "texmesh doctor", args.input, results);
  const std::vector<std::string> reasons = gate_failures(results);
  const std::string name = std::filesystem::path(args.input).filename().string();
  std::optional<std::string> auto_atlas;
  if (!is_package(args.input)) auto_atlas = auto_atlas_text(diagnosis);
  if (args.json) {
    std::cout << to_json_line(DoctorReport{name, diagnosis, reasons, notes, auto_atlas}) << '\n';
  } else {
    std::string text = printable(name) + "\n" + atlas_text(diagnosis);
    if (auto_atlas) text += *auto_atlas + "\n";
    text += gate_text(results);
    if (notes) text += "notes: " + notes_words(*notes) + "\n";
    std::cout << for_terminal(text);
  }
  return reasons.empty() ? kExitOk : kExitDifferent;
}

void add_limits(Command& c, AtlasLimits& limits) {
  const struct {
    const char* name;
    std::optional<double>& limit;
    double least, most;
    const char* help;
  } all[] = {
      {"--max-charts", limits.max_charts, 0, 1e9,
       "Largest number of charts of the model. Some 20 to 300 are usual for a scan that was unwrapped "
       "with care"},
      {"--max-floor", limits.max_floor_triangles, 0, 1e9,
       "Largest number of triangles that the coarsest mesh with all charts needs; 8 bytes each"},
      {"--min-cover", limits.min_cover, 0, 1, "Least share of each texture that is shown, 0 to 1"},
      {"--max-thin", limits.max_thin, 0, 1,
       "Largest share of a texture's shown texels in charts thinner than 8 texels, 0 to 1"},
      {"--max-overlap", limits.max_overlap, 0, 1,
       "Largest share of the shown texels that two places of the surface show, 0 to 1"},
      {"--max-flat", limits.max_flat, 0, 1,
       "Largest share of the surface that has no area on the texture, 0 to 1"},
      {"--max-density-spread", limits.max_density_spread, 1, 1e9,
       "Largest ratio of texels per length between the finest and the coarsest twentieth of the surface"},
      {"--max-stretch", limits.max_stretch, 1, 1e9,
       "Largest ratio of a texel's length to its width, on 95 % of the surface; 1 = square everywhere"},
      {"--max-seam-difference", limits.max_seam_difference, 0, 1000,
       "Largest difference of colours across seams, in the mean (CIE 1976; 2.3 can just be seen)"}};
  c.group("Limits (exit code 4 beyond one)");
  for (const auto& x : all) c.option(x.name, x.limit, x.help).number_in(x.least, x.most);
}

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
  static void fields(auto& s, auto&& v) {
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
  static void fields(auto& s, auto&& v) {
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
  static void fields(auto& s, auto&& v) {
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

void print_rendered(const RenderArguments& args, const RenderedModel& model, const PictureSheet& sheet) {
  RenderDocument document{args, model, sheet.pixels};
  for (std::size_t t = 0; t < model.textures.size(); ++t)
    document.textures.push_back(
        {model.textures[t].width_px, model.textures[t].height_px, model.texture_images[t].srgb});
  for (const SheetView& view : sheet.views) document.views.push_back({view, model.mesh.origin});
  std::cout << to_json_line(document) << '\n';
}

void tell_rendered(const RenderArguments& args, const RenderedModel& model, const PictureSheet& sheet) {
  double covered = 0;
  for (const SheetView& v : sheet.views) covered += v.covered_px;
  const double pixels = static_cast<double>(sheet.views.size()) * args.size_px * args.size_px;
  std::cout << fmt::format("{}: {}, {}, {} of {} px, {:.1f} % covered\n", printable(last_name(args.output)),
                           counted(model.mesh.triangles.size(), "triangle"),
                           counted(model.textures.size(), "texture"), counted(sheet.views.size(), "view"),
                           args.size_px, 100 * covered / pixels);
  print_warnings(model.notes);
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
  PercentLine progress("render");
  RenderedModel model = model_of(args, context);
  if (args.unlit) make_unlit(model);
  const RenderEnvironment environment =
      environment_of(args.environment == "white" ? RenderLight::kWhite : RenderLight::kStudio, context);
  const PictureSheet sheet =
      render_sheet(model, environment, args.views, static_cast<std::uint32_t>(args.size_px), context);
  progress.end();
  note_empty_picture(sheet, model);
  write_output_file(args.output, write_png(sheet.pixels));
  if (args.json)
    print_rendered(args, model, sheet);
  else
    tell_rendered(args, model, sheet);
  return kExitOk;
}

void add_render_options(Command& c, RenderArguments& args) {
  c.option("INPUT", args.input,
           "A model that compile takes (glTF, GLB, OBJ, PLY, STL, ZIP archive, range scan), or a package: a "
           ".texmesh file or a folder that unpack made")
      .required();
  c.option(
       "-o,--output", args.output,
       "The picture to write, x.png; with --what also x.glb, to turn in any viewer, and of scales x.csv and "
       "x.ply, the scale map as data",
       "FILE")
      .required();
  c.option(
       "--views", args.views,
       "Views, which become one sheet, row by row: directions spread evenly over the sphere. A single one "
       "shows the front from its right, a little from above")
      .integer_in(1, kMaxSheetViews)
      .shows_default();
  c.option("--size", args.size_px, "Side of one view, px", "PX").integer_in(1, 8192).shows_default();
  c.option("--scale", args.scale,
           "Of a package: this scale (texmesh dump lists the scales). Default: 0, the finest. All scales are "
           "seen "
           "by the same cameras")
      .integer_in(0, 99);
  c.option(
      "--rung", args.rung,
      "Of a package: quality of the textures. A rung's number, 0 = lowest, textures with fewer rungs show "
      "their best; max = the best of each (default); source = the source images where the package keeps "
      "them; preview = those of the first picture",
      "RUNG");
  c.option(
       "--environment", args.environment,
       "studio = the light of all measurements: soft boxes and one key light. white = the same light from "
       "everywhere, which shows what materials swallow",
       "LIGHT")
      .one_of_explained({"studio", "white"})
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
       "a feature (of models alone)",
       "QUANTITY")
      .one_of_explained(names);
  add_painting_options(c, args.painting);
}

}  // namespace

void add_dump_command(Command& app) {
  auto [c, args] = app.add("dump", "List the contents of a package and say what takes its bytes", run_dump);
  add_package_argument(c, args.package, false);
  c.choice(
       "PART", args.part,
       "summary: bounds, scales, textures, bytes by kind, options. scales: the meshes, when each is "
       "enough, and the stream between them. fragments: the texture's grid, importance and sizes. ladder: the rungs' bytes and "
       "distortion. tables: size model, allocation, measured quality. perceptual: how much scales differ, "
       "the thesis's Tables 7.1 and 7.2. atlas: charts of the textures and what they "
       "cost, as texmesh doctor has it; measured from S_0, which takes a moment. entries: every file with "
       "offset and digest. annotations: notes at points. about: title, licence, unit and all else that is said about the object. provenance: inputs, "
       "options, versions. all: everything")
      .shows_default();
  c.option(
       "--gamma", args.gamma,
       "With tables: quality and bytes of every fragment at this Gamma (0 to 1) of the allocation, instead "
       "of the default Gamma, the mean of eta",
       "G")
      .number_in(0, 1);
  c.flag("--json", args.json, "Print one JSON object");
  c.examples(
      "  texmesh dump bust.texmesh                      the page to read first\n"
      "  texmesh dump bust.texmesh ladder               what each texture quality costs\n"
      "  texmesh dump bust.texmesh tables --gamma 0.3   what each fragment gets then\n"
      "  texmesh dump bust.texmesh entries | sort -n -k2   which entries are large");
  c.notes("Exit code: 0, 1 when the package cannot be read, 2 usage.");
}

void add_verify_command(Command& app) {
  auto [c, args] =
      app.add("verify", "Check every byte of packages: digests, documents, meshes, images", run_verify);
  c.option("PACKAGES", args.packages, ".texmesh files or unpacked folders").required();
  add_jobs_option(c, args.jobs);
  c.option("--memory-mib", args.memory_mib, "Most memory; 0 = no limit", "MIB").shows_default();
  c.flag("--json", args.json, "Print one JSON object with all findings");
  c.flag("-q,--quiet", args.quiet, "Say nothing about sound packages");
  c.examples(
      "  texmesh verify out/*.texmesh\n"
      "  texmesh verify www/bust --json");
  c.notes(
      "verify decodes every mesh and every texture fragment and reports every finding. A finding names the "
      "entry, the place in the entry, what was expected, what was found and [the rule].\n"
      "A C2PA content credential (META-INF/content_credential.c2pa) is accepted and not checked.\n"
      "Exit code: 0 when all packages are sound, 1 when there is a finding, 2 usage.");
}

void add_diff_command(Command& app) {
  auto [c, args] = app.add("diff", "Say what differs between two packages, and why", run_diff);
  c.option("A", args.packages[0], "A .texmesh file, or a folder that unpack made").required();
  c.option("B", args.packages[1], "The other package").required();
  c.flag("--json", args.json, "Print one JSON object with every entry (schemas/diff.v1.schema.json)");
  c.examples(
      "  texmesh diff old.texmesh new.texmesh\n"
      "  texmesh diff old.texmesh new.texmesh --json | jq '.recorded'");
  c.notes(
      "diff compares entries by digest, and the records of what the packages were made from: inputs, "
      "options, versions of stages and libraries. For each stage whose entries differ diff names the "
      "recorded differences that can reach the stage. diff does not decode meshes and textures; verify "
      "does.\n"
      "Exit code: 0 the same package, 4 different, 1 a package cannot be read, 2 usage.");
}

void add_unpack_command(Command& app) {
  auto [c, args] = app.add(
      "unpack", "Write a package's entries as files, for servers or tools that want a folder", run_unpack);
  c.option("PACKAGE", args.package, "A .texmesh file").required();
  c.option("-o,--output", args.folder, "The folder to make; it must be empty or not exist", "DIR").required();
  c.option("--fragments", args.fragments,
           "packs: one file per texture and quality, as in the package. files: every fragment also as a "
           "complete JPEG with fragments.json beside, for servers that ignore Range requests",
           "packs|files")
      .one_of_explained({"packs", "files"})
      .shows_default();
  c.flag("--force", args.force,
         "Replace DIR where it holds an unpacked package; other folders are never replaced");
  c.examples(
      "  texmesh unpack bust.texmesh -o www/bust\n"
      "  texmesh unpack bust.texmesh -o www/bust --fragments files --force");
  c.notes(
      "The folder works like the file: dump, verify and clients take either. Any unzip tool makes the same "
      "files; unpack also checks every digest, and DIR appears whole or not at all.\n"
      "Exit code: 0, 1 when the package is damaged or DIR cannot be made, 2 usage.");
}

void add_pack_command(Command& app) {
  auto [c, args] = app.add("pack", "Put an unpacked package together again, byte for byte", run_pack);
  c.option("DIR", args.folder, "A folder that unpack made").required();
  c.option("-o,--output", args.package, "The .texmesh file to write", "PKG").required();
  c.examples("  texmesh pack www/bust -o bust.texmesh");
  c.notes(
      "pack checks every file against its digest first. It refuses files that are not of the package and "
      "leaves fragment files out. The package appears whole or not at all.\n"
      "Exit code: 0, 1 when the folder is not an unpacked package or PKG cannot be written, 2 usage.");
}

void add_doctor_command(Command& app) {
  auto [c, args] = app.add(
      "doctor", "Say what a model's texture atlas costs and what to do: a gate for CI, too", run_doctor);
  c.option("INPUT", args.input,
           "A model that compile takes, or a package: a .texmesh file or a folder that unpack made")
      .required();
  add_jobs_and_json_options(c, args.jobs, args.json, "schemas/doctor.v1.schema.json");
  c.option("--junit", args.junit, "Write a test case for every limit as JUnit XML", "FILE");
  add_limits(c, args.limits);
  c.examples(
      "  texmesh doctor scan.glb                                      figures and what to do\n"
      "  texmesh doctor scan.glb --max-charts 500 --min-cover 0.5     refuses a bad atlas in CI\n"
      "  texmesh doctor scan.texmesh --json                           the same of a package's finest scale\n"
      "  texmesh render scan.glb --what atlas -o atlas.png            the charts as a picture");
  c.notes(
      "An atlas is a texture with the charts that a surface is cut into. Every chart has borders that no "
      "simplified mesh can give up. So no program makes a small coarse mesh of an atlas of thousands of "
      "charts. docs/atlas.md explains the figures.\n"
      "A model without textures or texture coordinates has no atlas: doctor says so, and every limit is "
      "kept.\n"
      "Exit code: 0, 4 beyond a limit, 1 when the input cannot be read, 2 usage, 3 internal error.");
}

void add_render_command(Command& app) {
  auto [c, args] = app.add("render", "Picture a model or a package as viewers show it, lit", run_render);
  add_render_options(c, args);
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
}

}  // namespace texmesh
