#include "format/rules/output_transform.h"

namespace texmesh {
namespace {

/// A rotation by a quarter about the axis that neither is nor becomes up.
Vec3d turned(Vec3d p, char up) {
  if (up == 'x') return {-p.y, p.x, p.z};
  if (up == 'z') return {p.x, p.z, -p.y};
  return p;
}

}  // namespace

Vec3d OutputTransform::operator()(Vec3d p) const { return turned(p + origin, up) * scale; }

Box3d OutputTransform::operator()(const Box3d& box) const {
  Box3d out;
  if (box.empty()) return out;
  out.extend((*this)(box.min));
  out.extend((*this)(box.max));
  return out;
}

std::array<double, 16> OutputTransform::matrix() const {
  const std::array<Vec3d, 3> axes{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
  std::array<double, 16> out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d axis = turned(axes[k], up) * scale;
    out[4 * k] = axis.x + 0.0, out[4 * k + 1] = axis.y + 0.0, out[4 * k + 2] = axis.z + 0.0;  // no -0
  }
  const Vec3d place = (*this)(Vec3d{});
  out[12] = place.x, out[13] = place.y, out[14] = place.z, out[15] = 1;
  return out;
}

OutputTransform output_transform(const About& about, Vec3d origin, bool keep_units) {
  OutputTransform out;
  out.origin = origin;
  if (!keep_units && about.metres_per_unit > 0) out.scale = about.metres_per_unit;
  if (!about.up_axis.empty()) out.up = about.up_axis.front();
  return out;
}

About transformed_about(About about, const OutputTransform& transform) {
  if (transform.scale != 1) about.unit = "m", about.metres_per_unit = 1;
  if (transform.turns()) about.up_axis = "y";
  return about;
}

std::string units_note(const About& about, const OutputTransform& transform) {
  if (about.metres_per_unit == 0)
    return "the unit of length is not known; programs that read glTF take lengths for metres (texmesh compile --meta tells the unit)";
  if (transform.scale != 1)
    return "lengths are metres; the source has " + about.unit + " (--keep-units keeps them)";
  if (about.metres_per_unit != 1)
    return "lengths are in " + about.unit + "; programs that read glTF take them for metres";
  return "";
}

}  // namespace texmesh
