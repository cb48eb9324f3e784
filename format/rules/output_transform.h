#pragma once
#include <array>

#include "format/base/vec.h"
#include "format/documents/about.h"

namespace texmesh {

/// How files for other programs hold an object: y points up and lengths are metres, as in glTF, where the
/// package knows its axes and its unit; the object stands where its source has it. It is one transform for
/// whatever leaves a package: meshes, tiles, boxes, cameras, points. A package itself keeps the unit and the
/// axes of its source.
///
/// A point p of the package's meshes, in object units, becomes `scale` times the turned p + `origin`.
struct OutputTransform {
  Vec3d origin;      // object units, axes of the package; 0 = the object stays near 0
  double scale = 1;  // metres of the object unit; 1 = lengths stay object units
  char up = 'y';     // the package's axis that becomes y: x, y or z, by a rotation

  Vec3d operator()(Vec3d p) const;
  Box3d operator()(const Box3d& box) const;
  /// The same as a matrix of glTF: column by column. Its numbers but the origin's are 0 or +-scale: exact.
  std::array<double, 16> matrix() const;
  bool turns() const { return up != 'y'; }
  bool changes_nothing() const { return origin == Vec3d{} && scale == 1 && !turns(); }
};

/// The transform of a package that says `about` of itself and whose meshes stand at `origin`
/// (Manifest::origin). `keep_units` leaves lengths object units.
OutputTransform output_transform(const About& about, Vec3d origin, bool keep_units);

/// What is known of an object whose lengths and axes went through the transform.
About transformed_about(About about, const OutputTransform& transform);

/// What a user must know of the lengths, as a sentence; "" of a source in metres.
std::string units_note(const About& about, const OutputTransform& transform);

}  // namespace texmesh
