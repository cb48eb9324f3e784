#include "lab/experiment/make_experiment.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "format/base/errors.h"
#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "lab/experiment/page_files.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/uri.h"
#include "stages/image/png_writer.h"
#include "stages/render/shade.h"
#include "tools/render/picture_sheet.h"

namespace texmesh {
namespace {

constexpr double kElevationRad = 0.26;
constexpr std::uint32_t kMostFramePx = 4096;

/// View `index` of a turn around +Y, seen a little from above.
RenderCamera turn_camera(const StimulusSet& set, int index, int count) {
  const double turn = 2 * portable::kPi * index / count + 0.35;
  const Vec3d z =
      normalized(Vec3d{portable::sin(turn) * portable::cos(kElevationRad), portable::sin(kElevationRad),
                       portable::cos(turn) * portable::cos(kElevationRad)});
  const Vec3d x = normalized(cross(Vec3d{0, 1, 0}, z));
  return perspective_camera({x, cross(z, x), z, set.centre, set.radius});
}

/// Side of a picture in which an unchanged object is displayed so high at the sphere's centre.
std::uint32_t frame_px(const StimulusSet& set, double displayed_px) {
  const RenderCamera c = turn_camera(set, 0, 1);
  const double per_px = 2 * c.tan_half_fov * length(c.eye - set.centre) / set.object_height;
  return static_cast<std::uint32_t>(std::min(std::ceil(displayed_px * per_px), 1e9));
}

/// All views side by side.
Pixels render_strip(const StimulusSet& set, const StimulusSet::Shown& shown, int views, std::uint32_t side_px,
                    const RenderEnvironment& environment, const RunContext& context) {
  const auto width_px = side_px * static_cast<std::uint32_t>(views);
  Pixels strip{width_px, side_px, 3, std::vector<std::uint8_t>(std::size_t{width_px} * side_px * 3)};
  const RenderScene scene = shown.model.scene();
  for (int v = 0; v < views; ++v) {
    context.check_cancelled();
    const Visibility seen = look(scene, turn_camera(set, v, views), side_px, context);
    const Pixels view = encode_srgb(
        shade(scene, seen, shown.textures ? *shown.textures : shown.model.textures, environment, context));
    paste(view, static_cast<std::uint32_t>(v) * side_px, 0, strip);
  }
  return strip;
}

std::string background_of(const RenderEnvironment& environment) {
  const auto [red, green, blue] = background_colour(environment);
  return fmt::format("#{:02x}{:02x}{:02x}", red, green, blue);
}

/// Files by name, of the trials' pictures.
using Pictures = std::map<std::string, std::vector<std::uint8_t>>;

/// Which picture is which object at which level and size; by the order of trials.
struct Wanted {
  std::uint32_t condition = 0, object = 0;
  std::size_t level = 0;  // as StimulusSet::shown
  friend auto operator<=>(const Wanted&, const Wanted&) = default;
};

std::map<Wanted, std::vector<std::string>> wanted_pictures(const ExperimentDesign& design) {
  std::map<Wanted, std::vector<std::string>> out;
  const auto add = [&out](const Wanted& w, const std::string& name) {
    std::vector<std::string>& names = out[w];
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  for (const ExperimentTrial& t : design.trials) {
    add({t.condition, t.object, 0}, t.reference);
    add({t.condition, t.object, 0}, t.same);
    add({t.condition, t.object, t.level_index + 1}, t.changed);
  }
  return out;
}

/// Files of one size get one length, so that neither names nor sizes tell the changed one.
void pad_pictures(Pictures& pictures, std::uint64_t seed) {
  std::size_t longest = 0;
  for (const auto& [name, bytes] : pictures) longest = std::max(longest, bytes.size());
  SplitMix random(seed);
  for (auto& [name, bytes] : pictures) bytes = padded_png(bytes, longest + 12, random.bits());
}

void add_pictures(Experiment& experiment, const StimulusSet& set, const RenderEnvironment& environment,
                  const RunContext& context) {
  const std::map<Wanted, std::vector<std::string>> wanted = wanted_pictures(experiment.design);
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<Pictures> by_size(experiment.design.conditions.size());
  std::size_t done = 0;
  for (const auto& [picture, names] : wanted) {
    const std::uint32_t side_px = experiment.design.conditions[picture.condition].frame_px;
    const std::vector<std::uint8_t> png =
        write_png(render_strip(set, set.shown(picture.object, picture.level), experiment.design.options.views,
                               side_px, environment, quiet));
    for (const std::string& name : names) by_size[picture.condition][name] = png;
    context.report(static_cast<double>(++done) / static_cast<double>(wanted.size()));
  }
  for (std::size_t c = 0; c < by_size.size(); ++c) {
    pad_pictures(by_size[c], experiment.design.options.seed + c);
    for (auto& [name, bytes] : by_size[c]) experiment.files.push_back({"stimuli/" + name, std::move(bytes)});
  }
}

void add_page(Experiment& experiment, const std::string& design_json) {
  const std::string origin = url_origin(experiment.design.options.post_url);
  // What a Content-Security-Policy names to let the page post there; nothing for the page's own server.
  const std::string policy =
      "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'" +
      (origin.empty() ? "" : " " + markup_escaped(origin)) + "; base-uri 'none'; form-action 'none'";
  const std::string& title = experiment.design.options.title;
  const TemplateValues values{{"beginning", page_beginning(title, policy)}, {"title", markup_escaped(title)}};
  for (const BuiltInFile& file : experiment_page_files()) {
    const std::string text = file.name == "index.html" ? filled(file.text, values) : std::string(file.text);
    experiment.files.push_back({std::string(file.name), {text.begin(), text.end()}});
  }
  experiment.files.push_back({"design.json", {design_json.begin(), design_json.end()}});
}

FolderRule experiment_rule() {
  return {false, [](const std::filesystem::path&) { return false; },
          "an empty folder or nothing yet (an experiment is never replaced)", ""};
}

}  // namespace

std::vector<std::uint8_t> padded_png(const std::vector<std::uint8_t>& png, std::size_t size,
                                     std::uint64_t seed) {
  constexpr std::size_t kEndChunk = 12, kChunk = 12;
  const std::size_t fill = size - png.size() - kChunk;
  std::vector<std::uint8_t> chunk;
  const auto put = [&chunk](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) chunk.push_back(static_cast<std::uint8_t>(value >> shift));
  };
  put(static_cast<std::uint32_t>(fill));
  for (const char c : {'t', 'm', 'P', 'd'})
    chunk.push_back(static_cast<std::uint8_t>(c));  // skipped, private
  SplitMix random(seed);
  for (std::size_t k = 0; k < fill; ++k) chunk.push_back(static_cast<std::uint8_t>(random.bits()));
  put(static_cast<std::uint32_t>(crc32(0, chunk.data() + 4, static_cast<uInt>(chunk.size() - 4))));
  std::vector<std::uint8_t> out = png;
  out.insert(out.end() - kEndChunk, chunk.begin(), chunk.end());
  return out;
}

void check_pictures(const ExperimentOptions& options, const StimulusSet& stimuli) {
  const auto views = static_cast<std::uint32_t>(options.views);
  for (const double px : options.sizes_px) {
    const std::uint32_t side_px = frame_px(stimuli, px);
    if (side_px > kMostFramePx)
      throw InputError("--sizes", "", fmt::format("a picture of at most {} px", kMostFramePx),
                       fmt::format("{} px for a displayed size of {:g} px", side_px, px));
    if (side_px * views > kMostStripPx)
      throw InputError("--views", "",
                       fmt::format("at most {} views of {} px", kMostStripPx / side_px, side_px),
                       std::to_string(views));
  }
}

Experiment make_experiment(const ExperimentOptions& options, const StimulusSet& stimuli,
                           const RunContext& context) {
  check_pictures(options, stimuli);
  Experiment experiment;
  ExperimentDesign& design = experiment.design;
  design.options = options;
  design.levels = stimuli.levels;
  for (const double px : options.sizes_px) design.conditions.push_back({px, frame_px(stimuli, px)});
  const RenderEnvironment environment = studio_environment();
  design.background = background_of(environment);
  plan_trials(design);
  const std::string json = write_design(design);
  add_page(experiment, json);
  add_pictures(experiment, stimuli, environment, context);
  return experiment;
}

void write_experiment(const Experiment& experiment, const std::string& folder) {
  NewFolder out(folder, experiment_rule());
  for (const ExperimentFile& f : experiment.files) out.add(f.path, f.bytes);
  out.publish();
}

void check_experiment_folder(const std::string& folder) { NewFolder(folder, experiment_rule()); }

}  // namespace texmesh
