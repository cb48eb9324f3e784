#pragma once
#include "format/documents/manifest.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"

namespace texmesh {

// From how an object is looked at to the scale that is enough: what a client works out at run time from the
// numbers of the manifest. Lengths on screen are px, in the world object units; "displayed height" is the
// length on screen of the object's largest extent, Manifest::object_height (the thesis's D and O_V, 7.6).
// Pure functions, the same bits everywhere.

/// A perspective camera: what its picture is high, in px and in degrees.
struct Camera {
  double fov_degrees = 45;    // vertical, above 0 and below 180
  double viewport_px = 1080;  // height of the picture, > 0
};
/// Displayed height of the object at a viewing distance (camera to object, > 0).
double displayed_height_px(double object_height, double distance, const Camera& camera);
/// The distance at which the object is displayed that high; infinite for 0 px, 0 for kAnyDisplayPx and more.
double viewing_distance(double object_height, double height_px, const Camera& camera);

/// What decides about the scale: kFlip = lit pictures that cannot be told from S_0's, the default, which is
/// what Manifest::steps holds; kJnd = the just-noticeable difference; kError = an error of one pixel (95th
/// percentile); kEdge = the O_V / E_S that matches the displayed height best (thesis 7.6); kDistance = the
/// mapping of scale over distance (7.5, Fig. 7.13): S_i belongs to distance i, in whose place the major scale
/// of its tier is shown. S_0 is shown where the object is nearer than 1.
enum class StepRule { kFlip, kJnd, kError, kEdge, kDistance };
/// The thesis says no more of its units than that there are 20. Here the object is displayed kFirstDistancePx
/// high at distance 1, as the picture is on two of the four monitors of Table 7.3, and by kDistanceStep less
/// at every further one: 32 px at 20. By equal steps of the distance itself scales beyond S_5 change within
/// 20 %.
inline constexpr double kFirstDistancePx = 1024, kDistanceStep = 1.2;
/// The step function displayed height -> scale by one rule, coarse to fine; the last step is S_0's, up to
/// kAnyDisplayPx. A scale that accepts no more than a coarser one gives no step. `scales` as in a
/// manifest, S_0 first.
std::vector<ManifestStep> step_function(std::span<const ManifestScale> scales, StepRule rule);
/// The scale of the first step that reaches this height.
int scale_at(std::span<const ManifestStep> steps, double displayed_px);
/// Square pixels that a triangle must have on average to show, of the square of the displayed height.
inline constexpr double kLeastTrianglePx2 = 0.5;
/// The finest scale whose triangles show at a displayed height, whatever the step function calls enough;
/// the coarsest where those of none do.
int finest_shown(std::span<const ManifestScale> scales, double displayed_px);

/// The shape that the visible part of an object makes (thesis 7.2, Fig. 7.5).
struct VisiblePart {
  double width_px = 0, height_px = 0;  // both 0: nothing of the object is to be seen
  bool clipped = false;                // false: all of it
};

/// The scale for an object displayed `displayed_px` high (the whole of it, seen or not) of which only a part
/// is visible. The part is a shape of its own: no point of it is farther from its skeleton than half its
/// shorter side, so a distance between surfaces weighs more, relative to that, than on the whole object; and
/// the height that the JND goes by is the part's. By kDistance the object comes nearer as much as the
/// distance weighs more. The other rules know nothing of shapes and stay as they are. Nothing visible: the
/// coarsest scale. Not clipped: scale_at(step_function(...)).
int select_scale(const Manifest& manifest, double displayed_px, const VisiblePart& part,
                 StepRule rule = StepRule::kFlip);

/// How often the texels of a full-size plane may be halved until one stands for a pixel: log2 of texels per
/// pixel along a line, below 0 where there are fewer texels than pixels; 0 without covered texels.
/// `surface_area` of the object, object units squared; `object_height` = O_V.
double display_level(const PlaneTables& full_size, double surface_area, double object_height,
                     double displayed_px);

/// The plane of texture `base` with the largest mip that is at most `level`; `base` itself where there is
/// none.
std::uint32_t plane_at_level(std::span<const TextureInfo> textures, std::uint32_t base, double level);

/// Somebody loads an object.
struct OrdinaryLoad {
  double bytes_s = 0;       // of the link: 2 to 50 Mbit/s
  double displayed_px = 0;  // height of the object: 200 to 2,000
  double time_limit_s = 0;  // 1 to 10
};

/// The loads that a writer chooses rungs for. Each number is drawn from a logarithmic scale, the three of
/// them independently; the same ones on every machine. Fewer loads are the first ones of more.
std::vector<OrdinaryLoad> ordinary_loads(std::size_t count = 1000);

}  // namespace texmesh
