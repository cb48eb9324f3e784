#include <cmath>

#include "format/base/errors.h"
#include "format/base/no_index.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/import/finish_model.h"
#include "pipeline/import/import.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/obj/obj_libraries.h"
#include "pipeline/import/obj/obj_reader.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

bool has_colour(const ObjData& data, std::uint32_t position) {
  return position < data.colours.size() && std::isfinite(data.colours[position].x);
}

double scale_of_largest(const ObjData& data) {
  float largest = 0;
  for (const Vec3f& c : data.colours)
    for (int i = 0; i < 3; ++i) largest = c[i] > largest ? c[i] : largest;
  return largest > 1.001f ? 1 / 255.0 : 1;
}

bool textured(const Model& model, std::uint16_t material) {
  return model.materials[material].base_colour_texture.used();
}

/// Colours count on untextured faces only, and there they are the colour: Kd is not multiplied in (but with
// obj_kd multiply).
bool choose_colours(const ObjData& data, Model& model, const ImportOptions& options) {
  if (data.colours.empty()) return false;
  std::vector<std::uint8_t> coloured(model.materials.size(), 0);
  bool any = false, beside_texture = false;
  for (std::size_t f = 0; f < data.faces.size(); ++f)
    for (const ObjCorner& r : data.corners_of(f)) {
      if (!has_colour(data, r.position)) continue;
      const std::uint16_t m = data.faces[f].material;
      if (textured(model, m))
        beside_texture = true;
      else
        coloured[m] = 1, any = true;
    }
  if (beside_texture)
    add_info(model.notes, "colours-beside-texture", "", "vertex colours are left out where a texture shows");
  for (std::size_t m = 0; m < coloured.size(); ++m)
    if (coloured[m] && options.obj_kd == KdPolicy::kIgnore)
      model.materials[m].base_colour = {1, 1, 1, model.materials[m].base_colour.w};
  return any;
}

Mesh build_mesh(const ObjData& data, Model& model, const ImportOptions& options, const RunContext& context) {
  bool any_uv = false, any_normal = false;
  for (const ObjCorner& r : data.corners) {
    any_uv = any_uv || r.uv != kNoIndex;
    any_normal = any_normal || r.normal != kNoIndex;
  }
  const bool any_colour = choose_colours(data, model, options);
  const double scale = scale_of_largest(data);
  MeshBuilder builder(data.positions, {any_uv, any_normal, any_colour});
  std::vector<Corner> corners;
  std::uint64_t without_uv = 0;
  for (std::size_t f = 0; f < data.faces.size(); ++f) {
    if (f % 65536 == 0) context.check_cancelled();
    const ObjFace& face = data.faces[f];
    const bool face_textured = textured(model, face.material);
    bool lacks_uv = false;
    corners.clear();
    for (const ObjCorner& r : data.corners_of(f)) {
      Corner c;
      c.position = r.position;
      if (r.uv != kNoIndex)
        c.uv = data.uvs[r.uv];
      else
        lacks_uv = true;
      if (r.normal != kNoIndex) c.normal = data.normals[r.normal];
      if (any_colour && !face_textured && has_colour(data, r.position)) {
        const Vec3d rgb = to_double(data.colours[r.position]) * scale;
        c.colour = {linear_from_srgb(rgb.x), linear_from_srgb(rgb.y), linear_from_srgb(rgb.z), 1};
      }
      corners.push_back(c);
    }
    without_uv += lacks_uv && face_textured;
    builder.add_face(corners, face.material, face.part);
  }
  if (without_uv)
    add_warning(model.notes, "missing-uv", "",
                std::to_string(without_uv) + " faces of textured materials have no texture coordinates");
  return builder.finish();
}

void add_notes(const ObjData& data, Model& model) {
  if (data.small_faces)
    add_warning(model.notes, "face-without-area", "",
                std::to_string(data.small_faces) + " faces of fewer than three corners left out");
  if (data.lines_and_points)
    add_info(model.notes, "lines-and-points", "",
             std::to_string(data.lines_and_points) + " line and point elements left out");
  if (data.parts_full)
    add_info(model.notes, "many-parts", "", "more groups than parts can be told apart; the rest is one part");
}

}  // namespace

ImportedModel import_obj(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  const ObjData data = read_obj(file_name, text_of(bytes), options, context);
  if (data.positions.empty()) throw InputError(file_name, "", "an OBJ with v statements", "none");
  if (data.faces.empty()) throw InputError(file_name, "", "faces", "none");
  ImportedModel out;
  out.format = "obj";
  out.about = about_from_comments(obj_comments(text_of(bytes)), out.format, out.model.notes);
  add_obj_materials(data, file_name, out.model, resolver, options);
  out.model.mesh = build_mesh(data, out.model, options, context);
  out.model.mesh.part_names = data.parts;
  add_notes(data, out.model);
  finish_model(out.model, file_name, options);
  return out;
}

}  // namespace texmesh
