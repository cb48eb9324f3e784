#pragma once

#include "lab/experiment/design.h"
#include "tools/render/rendered_model.h"

namespace texmesh {

/// A closed surface around the origin whose longest side is 2, with a pattern that follows it when it is
/// changed.
struct StimulusShape {
  struct Wave {
    Vec3d towards;  // its length is the frequency
    double phase = 0, height = 0;
  };
  Vec3d axes{1, 1, 1};
  Vec3d changes{1, 1, 1};     // per axis: 1 = a change scales it
  std::vector<Wave> relief;   // of the radius, relative; empty for ellipsoids
  std::vector<Wave> pattern;  // band-limited random noise (7.3)
  Vec3d tint{0.5, 0.5, 0.5};  // linear RGB of the pattern's mean
};

/// So many shapes. Ellipsoids: axes drawn, one, two or none of them exempt from changes (7.3.1). Quadrics:
/// drawn reliefs on top, and their depth (z) alone changes (7.3.3). Six patterns take turns.
std::vector<StimulusShape> draw_shapes(StimulusKind kind, int count, std::uint64_t seed);

/// The shape with the axes that change scaled by 1 + change. Normals are those of its triangles, smoothed.
Mesh shape_mesh(const StimulusShape& shape, double change);

/// What judges are shown: objects, and changes of them.
struct StimulusSet {
  struct Shown {
    RenderedModel model;
    const std::vector<RenderTexture>* textures = nullptr;  // null: the model's own
  };
  std::size_t objects = 1;
  std::vector<double> levels;  // rising
  Vec3d centre;
  double radius = 1;         // of the sphere that holds every object, changed or not
  double object_height = 2;  // the longest side of an unchanged object
  /// Level 0 = unchanged, k = levels[k - 1], levels.size() + 1 = the change of catch trials.
  std::function<Shown(std::size_t object, std::size_t level)> shown;
};

/// Ellipsoids or quadrics, by the options' levels, objects and seed.
StimulusSet shape_stimuli(const ExperimentOptions& options);

/// Scales of a package with its best textures. Levels: their p95 against S_0, of those between 0.005 and 0.4
/// the ten that part them best. The catch trial squeezes the coarsest scale to 0.55 of its height. `package`
/// must outlive the set. InputError when fewer than three scales serve; FormatError when the package is
/// damaged.
StimulusSet package_stimuli(PackageReader& package, const RunContext& context);

/// The first line of an experiment's page.
inline constexpr const char* kExperimentFirstLine = "<!DOCTYPE html><!-- texmesh-lab experiment 1 -->\n";

struct ExperimentFile {
  std::string path;  // relative to the experiment's folder
  std::vector<std::uint8_t> bytes;
};

struct Experiment {
  ExperimentDesign design;
  std::vector<ExperimentFile> files;  // index.html first
};

/// Longest side of a strip of views, px: what browsers decode everywhere.
inline constexpr std::uint32_t kMostStripPx = 16384;

/// UsageError naming the option, --sizes or --views, when a picture would be too large.
void check_pictures(const ExperimentOptions& options, const StimulusSet& stimuli);

/// Renders every stimulus with the reference renderer in the light of all measurements, from `views`
/// directions around it, side by side in one picture. Pictures of one size have equal sides and equal lengths
/// in bytes. Errors as check_pictures(). Same bytes for any thread count and machine.
Experiment make_experiment(const ExperimentOptions& options, const StimulusSet& stimuli,
                           const RunContext& context);

/// Writes the folder, which appears whole or not at all. InputError when it holds files: what judges are
/// asked is never replaced.
void write_experiment(const Experiment& experiment, const std::string& folder);
/// The same refusals, before the work.
void check_experiment_folder(const std::string& folder);

/// A PNG file made `size` bytes long by a private chunk that decoders skip, filled with bytes drawn from
/// `seed`; size >= png.size() + 12.
std::vector<std::uint8_t> padded_png(const std::vector<std::uint8_t>& png, std::size_t size,
                                     std::uint64_t seed);

}  // namespace texmesh
