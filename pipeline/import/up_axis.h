#pragma once
#include "format/documents/annotations.h"
#include "pipeline/import/import.h"

namespace texmesh {

/// The axis on which the object probably stands upright: 'y' or 'z', or '\0' where its shape does not tell.
/// It stands on a bottom: a plane at its low end that looks down, or the plane of the rim of its only
/// opening. The bottom must lie beneath the centre of its surface, which lies low, and be three times as
/// large as what any other end has. Thin objects tell nothing: a floor of z up and a painting of y up are one
/// shape. Linear in the triangles, but for a sort of the edges of meshes that are open.
char guessed_up(const Mesh& mesh);

/// Turns the mesh with its origin so that `up`, x, y or z, becomes y: a quarter about the axis that neither
/// is nor becomes up, as OutputTransform turns.
void turn_up(Mesh& mesh, char up);

/// The member of About::source that tells of a turn.
inline constexpr const char* kTurnedMember = "turned";

/// A point or direction, turned so.
template <class T>
Vec3<T> turned_up(Vec3<T> v, char up) {
  return up == 'x' ? Vec3<T>{-v.y, v.x, v.z} : up == 'z' ? Vec3<T>{v.x, v.z, -v.y} : v;
}

/// The axis of the source that became y: by the user's word, else as import_model() has told it in
/// About::source. 'y' where nothing was turned.
char turned_axis(const About& about, UpAxis up);

/// Notes as PackageOptions::annotations has them, as a package has them: turned as the mesh of `source` was,
/// and moved from the source's coordinates to those of meshes at `origin`, unless they are there already.
/// Those outside `box`, the bounds of the meshes, cost a warning. "" stays "".
std::string placed_annotations(const std::string& json, const About& source, UpAxis up, Vec3d origin,
                               const Box3d& box, Notes& notes);

}  // namespace texmesh
