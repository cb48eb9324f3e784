#pragma once

#include "pipeline/import/import.h"
#include "stages/base/first_use_table.h"

namespace texmesh {

/// Beyond this a coordinate is no measure of anything, and squares of differences would overflow a float.
inline constexpr double kLargestCoordinate = 1e18;
/// What a package's own meshes may have: half a step of a grid of one bit reaches twice as far, what is
/// wrapped around a mesh a little farther, and squares of differences are floats still.
inline constexpr double kLargestPackedCoordinate = 4 * kLargestCoordinate;

/// Positions in double precision -> mesh.origin and float positions in a local frame. The origin is 0 unless
/// the bounding box lies so far from it that float would lose more than 1e-7 of the diagonal; then it is the
/// box's centre, rounded to a float-exact value. What is no number, or beyond `largest`, becomes NaN.
/// mesh.rounding, where it is empty, becomes a float's unit in the last place of the largest coordinate, or
/// half a unit of the last decimal where the coordinates have few (text), if that is more.
void set_positions(Mesh& mesh, const std::vector<Vec3d>& positions, double largest = kLargestCoordinate);

/// sRGB in 0..1 to linear light, 0..1; NaN gives 1.
float linear_from_srgb(double srgb);

/// The material of formats that know no glTF: matte, not metallic, and seen from both sides, as the viewers
/// of OBJ, PLY and STL show a surface (open scans would have holes otherwise).
Material scan_material(std::string name);

/// What one corner of a face carries. Attributes the mesh has not got stay as they are here.
struct Corner {
  std::uint32_t position = 0;
  Vec2f uv;
  Vec3f normal;
  Vec4f colour{1, 1, 1, 1};
};

/// Collects faces whose corners carry values of their own and makes wedges of them: corners with the
/// same position and bit-equal attributes become one wedge, numbered by first use. Used by OBJ, PLY, STL
/// and range scans.
class MeshBuilder {
 public:
  struct Attributes {
    bool uv = false, normals = false, colours = false;
  };
  /// `positions` must outlive the builder; faces refer to them, in range (checked by the readers, who
  /// know the line).
  MeshBuilder(const std::vector<Vec3d>& positions, Attributes attributes);

  /// A polygon of three corners or more, in order; fewer are ignored. Triangulated by cutting ears in the
  /// plane of its area vector, so concave polygons stay inside themselves.
  void add_face(std::span<const Corner> corners, std::uint16_t material, std::uint16_t part);

  std::size_t triangle_count() const { return mesh_.triangles.size(); }
  /// The mesh, positions in their local frame (set_positions); the builder is empty afterwards.
  Mesh finish();

 private:
  std::uint32_t wedge(const Corner& corner);
  std::uint64_t hash(const Corner& corner) const;
  bool same(std::uint32_t wedge, const Corner& corner) const;
  Corner corner_of(std::uint32_t wedge) const;

  const std::vector<Vec3d>& positions_;
  Attributes attributes_;
  Mesh mesh_;
  FirstUseTable table_;  // of wedges
  std::uint64_t ear_work_ = 0;
  std::vector<Vec3d> points_;                         // of the polygon at hand
  std::vector<std::array<std::uint32_t, 3>> pieces_;  // its triangles
  std::vector<std::uint32_t> wedges_;
};

/// Triangles (indices into `points`) of a simple polygon in space. A quad takes the diagonal that folds
/// neither half over, the shorter one where both do; more corners are cut ear by ear. `work` counts inside
/// tests over all polygons of a model: past kMaxEarWork, and where no ear is left (a polygon that crosses
/// itself), what remains becomes a fan.
void triangulate_polygon(std::span<const Vec3d> points, std::vector<std::array<std::uint32_t, 3>>& triangles,
                         std::uint64_t& work);
inline constexpr std::uint64_t kMaxEarWork = 400'000'000;  // about two seconds

/// Counts what is left out. Strangers' files may have any number of kinds: those after the 32nd are "others".
void count_lost(Lost& lost, const std::string& what, std::uint64_t count = 1);

/// Warns ("trailing-bytes") of bytes behind the end that a file declares; blanks and zeros are padding.
void tell_trailing_bytes(Notes& notes, std::span<const std::uint8_t> bytes, std::uint64_t end);

/// Last step of the reader of glTF: drops triangles that refer to non-finite positions or UVs (warnings
/// "non-finite-position", "non-finite-uv": such UVs become 0), unused images and materials; sets part names;
/// checks the limits; throws InputError when no triangle is left.
void finish_model(Model& model, const std::string& file_name, const ImportOptions& options);
/// Last step of all others: also gives a scan without any colour light grey (a note says so where no other
/// note stands), and judges alpha (material_images.h).
void finish_scan(Model& model, const std::string& file_name, const ImportOptions& options,
                 const RunContext& context);

/// Leaves out triangles that nobody sees: those on the three points of an earlier one, turned round, whose
/// material shows both sides and hides them (opaque, or cut-out by the same texels). Which of the two shows
/// would depend on the order in which they are drawn, and no package keeps that. After materials and alpha
/// modes are known. `lost` counts those that look otherwise than the one before them.
void drop_hidden_twins(Model& model, const std::string& file_name, Lost& lost);

}  // namespace texmesh
