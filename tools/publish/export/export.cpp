#include "tools/publish/export/export.h"

#include <fmt/format.h>

#include "delivery/cpp/decide/texture_loss.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "format/rules/viewing.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/extract/usdz/usdz.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/view/view_server.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

std::string document_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

constexpr double kHighestPx = 4096, kLowestPx = 32;
constexpr double kWaitingPx = 1;  // left as soon as something finer is there
/// Thinner boxes have no inside for a viewer, whose distances to them are those to a plane.
constexpr double kThinnest = 1e-4;

std::array<double, 3> turned(Vec3d v) { return {v.x, -v.z, v.y}; }

/// The centre, then half of each axis.
std::vector<double> box_of(const Box3d& bounds) {
  const std::array<double, 3> centre = turned(bounds.centre());
  const Vec3d half = bounds.size() * 0.5;
  const double least = std::max({half.x, half.y, half.z}) * kThinnest;
  std::vector<double> box(centre.begin(), centre.end());
  box.insert(box.end(), {std::max(half.x, least), 0.0, 0.0, 0.0, std::max(half.z, least), 0.0, 0.0, 0.0,
                         std::max(half.y, least)});
  return box;
}

double geometric_error(const Tileset& t, const TileLevel& level) {
  if (level.displayed_px >= kAnyDisplayPx) return 0;
  return t.metres * std::max(level.error_max, t.screen_error_px / level.displayed_px * t.object_height);
}

Json tile_json(const Tileset& t, const TileLevel& level) {
  Json tile{{"boundingVolume", {{"box", box_of(t.bounds)}}},
            {"geometricError", geometric_error(t, level)},
            {"refine", "REPLACE"},
            {"content", {{"uri", level.uri}}}};
  tile["extras"] = {{"scale", level.scale}, {"errorMax", level.error_max}};
  if (level.displayed_px < kAnyDisplayPx) tile["extras"]["displayedPx"] = level.displayed_px;
  return tile;
}

/// What asset.extras say of the object.
struct TilesetExtras {
  const About& about;
  static void fields(auto& s, auto&& v) {
    v("title", s.about.title, kMayMiss, "");
    v("creator", s.about.creator, kMayMiss, "");
    v("copyright", copyright_line(s.about), kMayMiss, "");
    v("licence", s.about.licence, kMayMiss, "");
    v("licenceUrl", s.about.licence_url, kMayMiss, "");
    v("epsg", s.about.epsg, kMayMiss, "");
  }
};

constexpr const char* kListFile = "export.json";
constexpr std::string_view kListBegin = "{\n  \"texmeshExport\": 1,";
/// A level of more than this share of the next finer one's bytes is not worth a request of its own.
constexpr double kWorthwhile = 0.75;
constexpr std::uint32_t kPhoneTexturePx = 4096;

std::string_view export_template(std::string_view name) { return built_in_text(export_page_files(), name); }

constexpr const char* kGlbFile = "model.glb";
constexpr const char* kUsdzFile = "model.usdz";
constexpr const char* kScriptFolder = "model-viewer";

std::string download_line(const std::string& name, std::uint64_t bytes) {
  return fmt::format("<p class=\"quiet\"><a href=\"{0}\" download=\"\">{0}</a>, {1}</p>\n", name,
                     markup_escaped(format_bytes(bytes)));
}

/// Notes as <model-viewer> shows them: buttons at points of the GLB, which `place` has placed.
std::string hotspots(PackageReader& package, const OutputTransform& place) {
  std::string out;
  int number = 0;
  for (const Json& note : placed_notes(package.annotations(), place)) {
    const auto words = [](const Json& v, const char* unit) {
      return fmt::format("{0}{3} {1}{3} {2}{3}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>(),
                         unit);
    };
    const std::string normal =
        note.contains("normal") ? fmt::format(" data-normal=\"{}\"", words(note["normal"], "")) : "";
    ++number;
    out += fmt::format(
        "<button class=\"note\" slot=\"hotspot-{0}\" data-position=\"{1}\"{2} title=\"{3}\" aria-label=\"{0}: {3}\">{0}</button>",
        number, words(note["position"], "m"), normal,
        markup_escaped(note["texts"][0]["title"].get<std::string>()));
  }
  return out;
}

/// index.html beside the files that `made` has: model.glb, and model.usdz where there is one.
std::string model_viewer_page(PackageReader& package, const ExportOptions& options, const Export& made,
                              const OutputTransform& place) {
  std::string downloads, ios;
  for (const ExportedFile& f : made.files) {
    downloads += download_line(f.path, f.bytes.size());
    if (f.path != kUsdzFile) continue;
    ios = fmt::format(R"( ios-src="{}")", kUsdzFile);
  }
  const About& about = package.about();
  const auto& poster = package.manifest().poster;
  const std::string title = package_title(package);
  const std::string script =
      options.script.empty() ? fmt::format("{}/{}", kScriptFolder, kModelViewerScript) : options.script;
  return filled(export_template("model-viewer.html"),
                {{"beginning", page_beginning(title, "")},
                 {"style", page_style(export_template("export.css"))},
                 {"title", markup_escaped(title)},
                 {"alt", markup_escaped(about.description.empty() ? title : about.description)},
                 {"poster", poster ? R"(<img slot="poster" src="poster.jpg" alt="">)" : ""},
                 {"script", markup_escaped(script)},
                 {"rights", rights_line(about)},
                 {"ios", ios},
                 {"hotspots", hotspots(package, place)},
                 {"notes", notes_html(package.annotations())},
                 {"downloads", downloads}});
}

/// index.html that frames `viewer`, an address relative to it, and says where oembed.json stands: `url`.
std::string oembed_page(const EmbeddedObject& object, const std::string& url, const std::string& viewer) {
  EmbeddedObject here = object;
  here.page_url = viewer;
  constexpr std::string_view kPolicy =
      "default-src 'none'; frame-src 'self'; img-src 'self' data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";
  return filled(export_template("oembed.html"), {{"beginning", page_beginning(object.about.title, kPolicy)},
                                                 {"style", page_style(export_template("export.css"))},
                                                 {"title", markup_escaped(object.about.title)},
                                                 {"oembed", markup_escaped(url + "oembed.json")},
                                                 {"frame", embedded_frame(here)},
                                                 {"code", markup_escaped(embedded_frame(object))},
                                                 {"rights", rights_line(object.about)}});
}

ExportedFile text_file(const char* path, const std::string& text) {
  return {path, {text.begin(), text.end()}};
}

void note_large_textures(const Extracted& extracted, Export& made) {
  for (const ExtractedImage& i : extracted.images)
    if (std::max(i.width_px, i.height_px) > kPhoneTexturePx) {
      made.notes.emplace_back("textures beyond 4096 px do not fit many phones; --display makes them smaller");
      return;
    }
}

/// The best-looking file of so many bytes, or the scale that suits the displayed height.
ExtractRequest request_for(const ExportOptions& options, ExtractScale::Form form) {
  if (options.bytes == 0) {
    ExtractScale scale;
    scale.display_px = options.display_px;
    scale.form = form;
    scale.images = options.images;
    return {scale, false, options.keep_units};
  }
  ExtractBudget budget;
  budget.bytes = {options.bytes};
  if (options.display_px > 0) budget.display_px = options.display_px;
  budget.images = options.images;
  budget.levels = form == ExtractScale::Form::kLevels;
  return {budget, false, options.keep_units};
}

ExtractScale::Form form_of(const ExportOptions& options) {
  return options.plain ? ExtractScale::Form::kPlain : ExtractScale::Form::kCoded;
}

void add_glb(Export& made, Extracted extracted, const std::string& path) {
  for (const std::string& note : extracted.notes)
    if (std::ranges::find(made.notes, note) == made.notes.end()) made.notes.push_back(note);
  if (!extracted.within) made.notes.push_back("no GLB comes below the bytes asked for");
  made.files.push_back({path, std::move(extracted.glb)});
}

/// Extends `bounds` by what the GLB holds, where its nodes put it.
void extend_by(const std::vector<std::uint8_t>& glb, const std::string& name, Box3d& bounds) {
  Findings findings;
  const GlbFacts facts = check_glb(glb, name, findings, GlbRules::kStandalone);
  if (facts.has_bounds) bounds.extend(Box3d{facts.bounds_min, facts.bounds_max});
}

void export_tiles(PackageReader& package, const ExportOptions& options, const RunContext& context,
                  Export& made) {
  const Manifest& m = package.manifest();
  Tileset tileset;
  tileset.about = package.about();
  const OutputTransform place = output_transform(package.about(), m.origin, options.keep_units);
  tileset.metres = place.scale;
  tileset.origin = place(Vec3d{});
  tileset.object_height = m.object_height;
  tileset.screen_error_px = options.screen_error_px;
  tileset.version = made.package_id.substr(0, 16);
  tileset.levels = tile_levels(m, options.display_px, [&](double px) {
    std::vector<std::uint32_t> planes;
    for (const PlaneChoice& c : px > 0 ? planes_for_display(package, px) : full_size(package))
      planes.push_back(c.plane);
    return planes;
  });
  ExtractScale scale;
  scale.form = form_of(options);
  scale.images = options.images;
  std::vector<TileLevel> wanted = std::move(tileset.levels);
  tileset.levels.clear();
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    scale.scale = wanted[k].scale;
    scale.display_px = wanted[k].texture_px;
    Extracted extracted = extract_model(package, {scale, true, options.keep_units}, context);
    context.report(static_cast<double>(k + 1) / static_cast<double>(wanted.size()));
    if (k > 0 && static_cast<double>(extracted.glb.size()) >
                     kWorthwhile * static_cast<double>(made.files.back().bytes.size()))
      continue;
    wanted[k].uri = "level-" + std::to_string(tileset.levels.size()) + ".glb";
    extend_by(extracted.glb, wanted[k].uri, tileset.bounds);
    if (k == 0) note_large_textures(extracted, made);
    add_glb(made, std::move(extracted), wanted[k].uri);
    tileset.levels.push_back(std::move(wanted[k]));
  }
  made.open = "tileset.json";
  made.files.push_back(text_file("tileset.json", tileset_text(tileset)));
}

void export_lods(PackageReader& package, const ExportOptions& options, const RunContext& context,
                 Export& made) {
  if (package.manifest().scales.size() < 2)
    throw InputError(package.store().name(), "scales", "two or more, for levels of detail (MSFT_lod)", "one");
  Extracted extracted = extract_model(package, request_for(options, ExtractScale::Form::kLevels), context);
  if (extracted.levels.size() < 2)
    throw InputError(
        package.store().name(), "scales",
        "a scale coarser than S_" + std::to_string(extracted.scale) + ", for levels of detail (MSFT_lod)",
        "none; texmesh extract writes the one");
  note_large_textures(extracted, made);
  made.open = "model.glb";
  add_glb(made, std::move(extracted), made.open);
}

void add_poster(PackageReader& package, Export& made) {
  if (const auto& poster = package.manifest().poster)
    made.files.push_back({"poster.jpg", package.entry(*poster)});
}

/// The USDZ that iPhones show: of the GLB's content, or for its number of bytes. A note where the object
/// cannot be one.
void add_usdz(PackageReader& package, const ExportOptions& options, const Extracted& extracted,
              const RunContext& context, Export& made) {
  try {
    if (options.bytes > 0) {
      ExportOptions wishes = options;
      wishes.images = options.images == ExtractImages::kPng ? ExtractImages::kPng : ExtractImages::kJpeg;
      const auto usdz = extract_usdz(package, request_for(wishes, ExtractScale::Form::kCoded), context);
      if (!usdz.front().within) made.notes.emplace_back("no USDZ comes below the bytes asked for");
      made.files.push_back({kUsdzFile, usdz.front().glb});
      return;
    }
    const About about =
        transformed_about(package.about(), output_transform(package.about(), {}, options.keep_units));
    Usdz usdz = usdz_of(extracted, about, package.store().name(), context);
    made.notes.insert(made.notes.end(), usdz.notes.begin(), usdz.notes.end());
    made.files.push_back({kUsdzFile, std::move(usdz.file)});
  } catch (const InputError& e) {
    made.notes.push_back("no " + std::string(kUsdzFile) + ": a USDZ cannot say " + e.found());
  }
}

void export_model_viewer(PackageReader& package, const ExportOptions& options, const RunContext& context,
                         Export& made) {
  const ExtractRequest request = request_for(options, form_of(options));
  const Vec3d origin = request.recentre ? Vec3d{} : package.manifest().origin;
  const OutputTransform place = output_transform(package.about(), origin, request.keep_units);
  Extracted extracted = extract_model(package, request, context);
  note_large_textures(extracted, made);
  made.open = "index.html";
  add_usdz(package, options, extracted, context, made);
  add_glb(made, std::move(extracted), kGlbFile);
  made.files.insert(made.files.begin(),
                    text_file("index.html", model_viewer_page(package, options, made, place)));
  if (options.script.empty()) made.copies.push_back({kScriptFolder, options.viewer});
  add_poster(package, made);
}

void export_oembed(PackageReader& package, const std::string& path, const ExportOptions& options,
                   Export& made) {
  EmbeddedObject object;
  object.about = package.about();
  object.about.title = package_title(package);
  std::string from_viewer = path;  // as the viewer's page names the package
  if (!is_web_url(path)) {
    check_completeness(package);
    const bool tree = package.store().is_folder();
    made.copies.push_back({tree ? "object" : "object.texmesh", path});
    from_viewer = tree ? "../object/" : "../object.texmesh";
  }
  made.copies.push_back({"viewer", options.viewer});
  const std::string viewer = "viewer/index.html?panel=none&pkg=" + percent_encoded(from_viewer);
  object.page_url = options.url + viewer;
  object.width_px = options.width_px;
  object.height_px = options.height_px;
  object.provider_url = url_origin(options.url);
  object.provider_name = options.provider.empty()
                             ? object.provider_url.substr(object.provider_url.find("://") + 3)
                             : options.provider;
  if (const auto& poster = package.manifest().poster) {
    object.thumbnail_url = options.url + "poster.jpg";
    object.thumbnail_width_px = poster->width_px;
    object.thumbnail_height_px = poster->height_px;
  }
  made.open = "index.html";
  made.files.push_back(text_file("oembed.json", oembed_answer(object)));
  made.files.push_back(text_file("index.html", oembed_page(object, options.url, viewer)));
  add_poster(package, made);
}

}  // namespace

void check_completeness(PackageReader& package) {
  PackageStore& store = package.store();
  if (!store.is_folder()) store.list();
  for (const EntryRef& e : package.entries()) {
    const bool may_be_files = store.is_folder() && parse_entry_path(e.path).kind == EntryKind::kRung;
    if (!may_be_files || fs::exists(fs::path(store.name()) / e.path)) store.read(e, 0, 0);
  }
}

std::vector<TileLevel> tile_levels(const Manifest& manifest, double display_px,
                                   const PlanesOfHeight& planes) {
  const auto level = [&](int scale, double displayed_px, double texture_px) {
    const auto found = std::ranges::find(manifest.scales, scale, &ManifestScale::scale);
    return TileLevel{scale, displayed_px, texture_px, found->error_max, ""};
  };
  const int finest = display_px > 0 ? scale_at(manifest.steps, display_px) : 0;
  std::vector<TileLevel> out{level(finest, kAnyDisplayPx, display_px)};
  std::vector<std::uint32_t> shown = planes(display_px);
  for (double px = kHighestPx; px >= kLowestPx; px /= 2) {
    if (display_px > 0 && px >= display_px) continue;
    const int scale = scale_at(manifest.steps, px);
    std::vector<std::uint32_t> these = planes(px);
    if (scale == out.back().scale && these == shown) continue;
    out.push_back(level(scale, px, px));
    shown = std::move(these);
  }
  const int coarsest = manifest.scales.back().scale;
  if (out.back().scale != coarsest) {
    const auto step = std::ranges::find(manifest.steps, coarsest, &ManifestStep::scale);
    out.push_back(level(coarsest, step == manifest.steps.end() ? kWaitingPx : step->up_to_px, kLowestPx));
  }
  return out;
}

std::string tileset_text(const Tileset& t) {
  Json tile;
  for (const TileLevel& level : t.levels) {
    Json outer = tile_json(t, level);
    if (!tile.is_null()) outer["children"] = Json::array({std::move(tile)});
    tile = std::move(outer);
  }
  const Json place = turned(t.origin);
  if (t.origin != Vec3d{})
    tile["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, place[0], place[1], place[2], 1};
  Json asset{{"version", "1.1"}, {"tilesetVersion", t.version}};
  if (Json about = to_json(TilesetExtras{t.about}); !about.empty()) asset["extras"] = std::move(about);
  const double whole = std::max(2 * t.metres * t.object_height, tile["geometricError"].get<double>());
  return document_text({{"asset", std::move(asset)}, {"geometricError", whole}, {"root", std::move(tile)}});
}

std::string embedded_frame(const EmbeddedObject& o) {
  return fmt::format(
      R"(<iframe src="{}" width="{}" height="{}" title="{}" style="border:0;max-width:100%" loading="lazy" allow="fullscreen"></iframe>)",
      markup_escaped(o.page_url), o.width_px, o.height_px, markup_escaped(o.about.title));
}

std::string oembed_answer(const EmbeddedObject& object) { return document_text(to_json(object)); }

Export make_export(PackageReader& package, const std::string& path, const ExportOptions& options,
                   const RunContext& context) {
  Export made;
  made.target = options.target;
  made.package_id = to_hex(package.id());
  switch (options.target) {
    case ExportTarget::k3dTiles:
      export_tiles(package, options, context, made);
      break;
    case ExportTarget::kGltfLod:
      export_lods(package, options, context, made);
      break;
    case ExportTarget::kModelViewer:
      export_model_viewer(package, options, context, made);
      break;
    case ExportTarget::kOembed:
      export_oembed(package, path, options, made);
      break;
  }
  for (const ExportedFile& f : made.files)
    if (f.path.ends_with(".glb") && f.bytes.size() > 0xffffffffu)
      throw InputError(package.store().name(), "", "what fits a GLB of 4 GiB",
                       std::to_string(f.bytes.size()));
  return made;
}

std::string export_list(const Export& made) { return document_text(to_json(made)); }

FolderRule export_folder_rule() {
  return marked_folder_rule(kListFile, kListBegin, "an empty folder, an earlier export, or nothing yet");
}

void write_export(const Export& made, const std::string& folder) {
  NewFolder out(folder, export_folder_rule());
  for (const ExportedFile& f : made.files) out.add(f.path, f.bytes);
  for (const ExportedCopy& c : made.copies) out.copy(c.path, c.source);
  out.add(kListFile, text_bytes(export_list(made)));
  out.publish();
}

}  // namespace texmesh
