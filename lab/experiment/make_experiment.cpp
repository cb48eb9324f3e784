// What judges are shown, and the page that shows it to them.
#include "lab/experiment/make_experiment.h"

#include <zlib.h>

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "format/base/errors.h"
#include "format/base/portable_math.h"
#include "format/base/vec.h"
#include "format/rules/split_mix.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/uri.h"
#include "stages/image/png_writer.h"
#include "stages/render/shade.h"
#include "tools/cli/options/units.h"
#include "tools/extract/package_model.h"
#include "tools/publish/pages/page.h"

namespace texmesh {

std::span<const BuiltInFile> experiment_page_files();  // of page/, made by CMake

namespace {

constexpr std::uint32_t kRings = 72, kSegments = 144;
constexpr int kPatterns = 6, kPatternWaves = 14, kReliefWaves = 5;
constexpr std::size_t kMostScales = 10, kLeastScales = 3;
constexpr double kLeastScaleLevel = 0.005, kMostScaleLevel = 0.4;

Vec3d random_direction(SplitMix& random) {
  const double z = random.between(-1, 1), angle = random.between(0, 2 * portable::kPi);
  const double r = std::sqrt(1 - z * z);
  return {r * portable::cos(angle), r * portable::sin(angle), z};
}

StimulusShape::Wave random_wave(SplitMix& random, double least, double most, double height) {
  const Vec3d towards = random_direction(random) * random.between(least, most);
  return {towards, random.between(0, 2 * portable::kPi), height};
}

double sum_of(const std::vector<StimulusShape::Wave>& waves, Vec3d direction) {
  double sum = 0;
  for (const StimulusShape::Wave& w : waves)
    sum += w.height * portable::cos(dot(w.towards, direction) + w.phase);
  return sum;
}

/// At least one axis changes: one, two or none is exempt.
Vec3d random_axes(SplitMix& random) {
  Vec3d out{1, 1, 1};
  const std::size_t exempt = random.below(3);
  while (out.x + out.y + out.z > 3 - static_cast<double>(exempt)) out[static_cast<int>(random.below(3))] = 0;
  return out;
}

/// One of the six patterns: how fine its noise is, and its tint.
void draw_pattern(StimulusShape& shape, int number, SplitMix& random) {
  const double frequency = 7 + 2.5 * (number % kPatterns);
  for (int k = 0; k < kPatternWaves; ++k)
    shape.pattern.push_back(
        random_wave(random, frequency, 1.3 * frequency, std::sqrt(2.0 / kPatternWaves) * 0.22));
  constexpr std::array<Vec3d, kPatterns> kTints{
      {{.42, .38, .33}, {.30, .38, .44}, {.36, .43, .32}, {.46, .36, .36}, {.40, .40, .40}, {.44, .42, .28}}};
  shape.tint = kTints[static_cast<std::size_t>(number % kPatterns)];
}

std::vector<Vec3d> grid_directions() {
  std::vector<Vec3d> out;
  for (std::uint32_t r = 0; r <= kRings; ++r)
    for (std::uint32_t s = 0; s < kSegments; ++s) {
      const double polar = portable::kPi * r / kRings, turn = 2 * portable::kPi * s / kSegments;
      const double ring = r == 0 || r == kRings ? 0 : portable::sin(polar);
      out.push_back({ring * portable::cos(turn), portable::cos(polar), -ring * portable::sin(turn)});
    }
  return out;
}

std::vector<Triangle> grid_triangles() {
  std::vector<Triangle> out;
  for (std::uint32_t r = 0; r < kRings; ++r)
    for (std::uint32_t s = 0; s < kSegments; ++s) {
      const std::uint32_t next = (s + 1) % kSegments;
      const std::uint32_t a = r * kSegments + s, b = (r + 1) * kSegments + s, c = (r + 1) * kSegments + next,
                          d = r * kSegments + next;
      if (r + 1 < kRings) out.push_back({a, b, c});
      if (r > 0) out.push_back({a, c, d});
    }
  return out;
}

void smooth_normals(Mesh& mesh) {
  std::vector<Vec3d> sums(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = to_double(mesh.positions[t[0]]), b = to_double(mesh.positions[t[1]]),
                c = to_double(mesh.positions[t[2]]);
    for (const std::uint32_t v : t) sums[v] = sums[v] + cross(b - a, c - a);
  }
  // The corners of a pole are one place.
  for (const std::size_t ring : {std::size_t{0}, std::size_t{kRings}}) {
    Vec3d all;
    for (std::size_t s = 0; s < kSegments; ++s) all = all + sums[ring * kSegments + s];
    for (std::size_t s = 0; s < kSegments; ++s) sums[ring * kSegments + s] = all;
  }
  for (const Vec3d& n : sums) mesh.normals.push_back(to_float(normalized(n)));
}

/// Its pole's corners stand at one place.
Vec3d shape_point(const StimulusShape& shape, Vec3d direction, double change) {
  const double radius = 1 + sum_of(shape.relief, direction);
  Vec3d p = direction * radius;
  for (int k = 0; k < 3; ++k) p[k] *= shape.axes[k] * (1 + change * shape.changes[k]);
  return p;
}

/// Scales the axes until the longest side is 2.
void normalise(StimulusShape& shape) {
  std::vector<Vec3f> points;
  for (const Vec3d& d : grid_directions()) points.push_back(to_float(shape_point(shape, d, 0)));
  const double longest = bounding_box(points).longest_side();
  shape.axes = shape.axes * (2 / longest);
}

RenderedModel shape_model(const StimulusShape& shape, double change) {
  RenderedModel model;
  model.mesh = shape_mesh(shape, change);
  RenderMaterial material;
  material.metallic = 0, material.roughness = 0.55f;
  model.materials.push_back(material);
  return model;
}

/// Scales of the package whose values serve, spread evenly over the logarithm of the values, fine to coarse.
std::vector<ManifestScale> chosen_scales(PackageReader& package) {
  std::vector<ManifestScale> fit;
  for (const ManifestScale& s : package.manifest().scales)
    if (s.p95 >= kLeastScaleLevel && s.p95 <= kMostScaleLevel) fit.push_back(s);
  std::ranges::stable_sort(fit, {}, &ManifestScale::p95);
  const auto same = [](const ManifestScale& a, const ManifestScale& b) { return b.p95 < a.p95 * 1.02; };
  fit.erase(std::unique(fit.begin(), fit.end(), same), fit.end());
  while (fit.size() > kMostScales) {
    std::size_t closest = 1;
    for (std::size_t k = 2; k + 1 < fit.size(); ++k)
      if (fit[k + 1].p95 / fit[k - 1].p95 < fit[closest + 1].p95 / fit[closest - 1].p95) closest = k;
    fit.erase(fit.begin() + static_cast<std::ptrdiff_t>(closest));
  }
  if (fit.size() < kLeastScales)
    throw InputError(package.store().name(), "", "at least 3 scales whose change is between 0.005 and 0.4",
                     std::to_string(fit.size()) + " (texmesh dump lists them as p95)");
  return fit;
}

void squeeze(RenderedModel& model, Vec3d centre) {
  for (Vec3f& p : model.mesh.positions)
    p.y = static_cast<float>(centre.y + (static_cast<double>(p.y) - centre.y) * (1 - kCatchLevel));
}

}  // namespace

std::vector<StimulusShape> draw_shapes(StimulusKind kind, int count, std::uint64_t seed) {
  SplitMix random(seed);
  std::vector<StimulusShape> out;
  for (int k = 0; k < count; ++k) {
    StimulusShape shape;
    for (int axis = 0; axis < 3; ++axis) shape.axes[axis] = random.between(0.55, 1);
    if (kind == StimulusKind::kQuadrics) {
      for (int w = 0; w < kReliefWaves; ++w) shape.relief.push_back(random_wave(random, 1.5, 4, 0.07));
      shape.changes = {0, 0, 1};
    } else {
      shape.changes = random_axes(random);
    }
    draw_pattern(shape, k, random);
    normalise(shape);
    out.push_back(std::move(shape));
  }
  return out;
}

Mesh shape_mesh(const StimulusShape& shape, double change) {
  Mesh mesh;
  mesh.part_names = {""};
  for (const Vec3d& d : grid_directions()) {
    mesh.wedge_position.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
    mesh.positions.push_back(to_float(shape_point(shape, d, change)));
    const double light = 1 + sum_of(shape.pattern, d) / 0.4;
    const auto channel = [light](double tint) {
      return static_cast<float>(std::clamp(tint * light, 0.02, 0.9));
    };
    mesh.colours.push_back({channel(shape.tint.x), channel(shape.tint.y), channel(shape.tint.z), 1});
  }
  mesh.triangles = grid_triangles();
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  mesh.triangle_part.assign(mesh.triangles.size(), 0);
  smooth_normals(mesh);
  return mesh;
}

StimulusSet shape_stimuli(const ExperimentOptions& options) {
  const auto shapes = std::make_shared<std::vector<StimulusShape>>(
      draw_shapes(options.kind, options.objects, SplitMix(options.seed).bits()));
  StimulusSet set;
  set.objects = shapes->size();
  set.levels = options.levels;
  double reach = 0;
  for (const StimulusShape& shape : *shapes)
    for (const Vec3f& p : shape_mesh(shape, set.levels.back()).positions)
      reach = std::max(reach, length(to_double(p)));
  set.radius = reach;
  // A change grows or shrinks; which of them, judges cannot learn.
  std::vector<double> signs;
  SplitMix random(~options.seed);
  for (std::size_t k = 0; k < set.objects * set.levels.size(); ++k) signs.push_back(random.below(2) ? 1 : -1);
  set.shown = [shapes, signs, levels = set.levels](std::size_t object, std::size_t level) {
    double change = 0;
    if (level > levels.size())
      change = -kCatchLevel;
    else if (level > 0)
      change = signs[object * levels.size() + level - 1] * levels[level - 1];
    return StimulusSet::Shown{shape_model((*shapes)[object], change), nullptr};
  };
  return set;
}

StimulusSet package_stimuli(PackageReader& package, const RunContext& context) {
  const std::vector<ManifestScale> scales = chosen_scales(package);
  const auto finest = std::make_shared<RenderedModel>(package_model(package, {}, context));
  StimulusSet set;
  std::vector<int> numbers{0};
  for (const ManifestScale& s : scales) set.levels.push_back(s.p95), numbers.push_back(s.scale);
  numbers.push_back(package.manifest().scales.back().scale);
  set.centre = finest->bounds.centre;
  set.radius = finest->bounds.radius;
  set.object_height = package.manifest().object_height;
  set.shown = [&package, finest, numbers, context](std::size_t, std::size_t level) {
    StimulusSet::Shown shown{package_scale(package, numbers[level], *finest, context), &finest->textures};
    if (level + 1 == numbers.size()) squeeze(shown.model, finest->bounds.centre);
    return shown;
  };
  return set;
}

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
    for (std::uint32_t place = 0; place < t.moved.size(); ++place)
      add({place, t.object, t.is_catch ? 0 : t.level_index + 1}, t.moved[place]);
    if (!t.moved.empty()) continue;
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
      throw UsageError("--sizes", "", fmt::format("a picture of at most {} px", kMostFramePx),
                       fmt::format("{} px for a displayed size of {:g} px", side_px, px));
    if (side_px * views > kMostStripPx)
      throw UsageError("--views", "",
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
  for (const double px : options.sizes_px)
    for (std::size_t place = 0; place < (options.move ? kPlaces : 1); ++place) {
      const double nearer = static_cast<double>(place) / static_cast<double>(kPlacesAnOctave);
      const double shown_px =
          place == 0 ? px : std::round(1000 * px / portable::exp(nearer * portable::log(2))) / 1000;
      design.conditions.push_back({shown_px, frame_px(stimuli, shown_px)});
    }
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
