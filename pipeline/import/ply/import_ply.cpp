#include "format/base/errors.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/import/finish_model.h"
#include "pipeline/import/import.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/ply/ply_surface.h"
#include "pipeline/import/text_scan.h"

// PLY has no specification of names beyond x, y, z. This is what MeshLab, CloudCompare, Metashape, Blender
// and VTK write, and what is read here:
//   vertex     x y z; nx ny nz; s t | u v | texture_u texture_v | texcoord_u texcoord_v;
//              red green blue alpha | r g b a | diffuse_red ...
//   face       vertex_indices | vertex_index; texcoord (u v per corner); texnumber;
//              red green blue alpha (of the whole face)
//   tristrips  vertex_indices; -1 ends a strip
//   comment TextureFile NAME: one per texture, in texnumber's order
// UVs run upwards as in OBJ. Colours are sRGB, integers in the range of their type and floats in 0..1.
// Colours beside a texture are a second record of the same surface: as in MeshLab, the texture shows and the
// colours do not.

namespace texmesh {
namespace {

/// Makes a model of a file's vertices and faces.
class PlyModel {
 public:
  PlyModel(const std::string& file, PlySurface surface, Resolver& resolver, const ImportOptions& options,
           const RunContext& context)
      : file_(file),
        surface_(std::move(surface)),
        resolver_(resolver),
        options_(options),
        context_(context) {}

  Model build() {
    add_materials();
    build_mesh();
    add_notes();
    finish_model(model_, file_, options_);
    return std::move(model_);
  }

 private:
  bool has_uv() const { return !surface_.vertices.uv.empty() || !surface_.faces.uv.empty(); }

  // Material 0 is untextured; one more for each TextureFile.
  void add_materials() {
    const Material plain = scan_material("untextured");
    model_.materials.push_back(plain);
    static constexpr std::string_view kKey = "TextureFile";
    for (const std::string& comment : surface_.comments) {
      std::string_view rest = comment;
      if (!same_word(next_token(rest), kKey) || trim(rest).empty()) continue;
      const std::string name(trim(rest));
      if (model_.materials.size() > 65534)
        throw InputError(file_, "header", "at most 65534 textures", "more");
      Material material = plain;
      material.name = name;
      if (has_uv())
        material.base_colour_texture.image =
            add_image(model_, name, resolver_, file_, "comment TextureFile", options_);
      model_.materials.push_back(std::move(material));
    }
    if (model_.materials.size() > 1 && !has_uv())
      add_warning(model_.notes, "texture-without-uv", "header",
                  "a TextureFile is named but there are no texture coordinates");
  }

  std::uint16_t material_of(std::size_t face) const {
    if (face < surface_.faces.has_uv.size() && !surface_.faces.has_uv[face] && surface_.vertices.uv.empty())
      return 0;
    const std::int32_t texture = face < surface_.faces.texture.size() ? surface_.faces.texture[face] : 0;
    const auto materials = static_cast<std::int32_t>(model_.materials.size());
    return texture < 0 || texture + 1 >= materials ? 0 : static_cast<std::uint16_t>(texture + 1);
  }

  bool textured(std::uint16_t material) const {
    return model_.materials[material].base_colour_texture.used();
  }

  void build_mesh() {
    bool all_textured = true;
    for (std::size_t f = 0; f < surface_.faces.count() && all_textured; ++f)
      all_textured = textured(material_of(f));
    const bool any_colours = !surface_.vertices.colours.empty() || !surface_.faces.colours.empty();
    if (any_colours && all_textured)
      add_info(model_.notes, "colours-beside-texture", "",
               "vertex or face colours are left out where a texture shows");
    MeshBuilder builder(surface_.vertices.positions,
                        {has_uv(), !surface_.vertices.normals.empty(), any_colours && !all_textured});
    std::vector<Corner> corners;
    for (std::size_t f = 0; f < surface_.faces.count(); ++f) {
      if (f % 65536 == 0) context_.check_cancelled();
      const std::uint16_t material = material_of(f);
      corners.clear();
      for (std::size_t k = surface_.faces.begin[f]; k < surface_.faces.begin[f + 1]; ++k)
        corners.push_back(corner(f, k, textured(material)));
      builder.add_face(corners, material, 0);
      if (corners.size() < 3) ++small_faces_;
    }
    model_.mesh = builder.finish();
  }

  Corner corner(std::size_t face, std::size_t k, bool is_textured) const {
    Corner c;
    c.position = surface_.faces.index[k];
    const bool face_has_uv = face < surface_.faces.has_uv.size() && surface_.faces.has_uv[face];
    if (face_has_uv)
      c.uv = surface_.faces.uv[k];
    else if (!surface_.vertices.uv.empty())
      c.uv = surface_.vertices.uv[c.position];
    if (!surface_.vertices.normals.empty()) c.normal = surface_.vertices.normals[c.position];
    if (is_textured) return c;
    // Colours of vertices say more than colours of faces, where a file has both (MeshLab's default face
    // colour is white).
    if (!surface_.vertices.colours.empty())
      c.colour = surface_.vertices.colours[c.position];
    else if (k < surface_.faces.colours.size())
      c.colour = surface_.faces.colours[k];
    return c;
  }

  void add_notes() {
    if (surface_.long_lines)
      add_warning(model_.notes, "over-long-lines", surface_.first_long_line,
                  std::to_string(surface_.long_lines) +
                      " lines have more numbers than the header declares; what it declares is read");
    if (surface_.odd_texcoords)
      add_warning(model_.notes, "odd-texcoord-list", "element face",
                  std::to_string(surface_.odd_texcoords) +
                      " faces whose texcoord list does not hold two numbers per corner");
    if (small_faces_)
      add_warning(model_.notes, "face-without-area", "element face",
                  std::to_string(small_faces_) + " faces of fewer than three corners left out");
  }

  const std::string& file_;
  PlySurface surface_;
  Resolver& resolver_;
  const ImportOptions& options_;
  const RunContext& context_;
  Model model_;
  std::uint64_t small_faces_ = 0;
};

}  // namespace

ImportedModel import_ply(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  ImportedModel out;
  PlySurface surface = read_ply_surface(file_name, bytes, options, context);
  out.format = "ply";
  Notes notes;
  out.about = about_from_comments(surface.comments, out.format, notes);
  out.model = PlyModel(file_name, std::move(surface), resolver, options, context).build();
  out.model.notes.insert(out.model.notes.end(), notes.begin(), notes.end());
  return out;
}

}  // namespace texmesh
