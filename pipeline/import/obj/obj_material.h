#pragma once

#include "pipeline/import/import.h"

namespace texmesh {

/// A texture statement of an MTL: options come before the file name, which runs to the end of the
/// line, blanks included.
struct MtlTexture {
  std::string file;  // as written
  std::size_t line = 0;
  Vec2d scale{1, 1}, offset{0, 0};  // -s, -o: uv' = scale * uv + offset, v upwards
  bool clamp = false;               // -clamp on
  double bump = 1;                  // -bm
};

struct MtlMaterial {
  std::string name;
  std::optional<Vec3d> diffuse, emission;     // Kd, Ke as written
  std::optional<double> opacity;              // d
  std::optional<double> transparency;         // Tr as written
  std::optional<double> roughness, metallic;  // Pr, Pm
  std::optional<MtlTexture> map_kd, map_ka, map_ke, map_d, map_pr, map_pm, bump, norm;
  std::vector<std::string> left_out;  // texture statements without a counterpart: "map_Ks line 7"
};

struct MtlFile {
  std::vector<MtlMaterial> materials;
  bool by_meshlab = false;  // its Tr is an opacity
  Lost unread;              // statements, by their first word
};

/// f(the name of a map), for all that a material has.
template <class M, class F>
void for_each_map(M& material, F&& f) {
  for (auto* map : {&material.map_kd, &material.map_ka, &material.map_ke, &material.map_d, &material.map_pr,
                    &material.map_pm, &material.bump, &material.norm})
    if (*map) f((*map)->file);
}

/// The material with the maps of one tile.
MtlMaterial of_tile(MtlMaterial material, std::uint16_t tile);

/// The names in a line `mtllib`, taken as several: in quotes, or between blanks. The line may as well be one
/// name with blanks.
std::vector<std::string> names_of_libraries(std::string_view rest);

/// Never fails: what is no statement is ignored, a number that is none leaves the default (Kd and the like
/// are looks, not geometry) with one warning.
MtlFile read_mtl(const std::string& name, std::span<const std::uint8_t> bytes, Notes& notes);

/// A library that an OBJ names, read.
struct LoadedLibrary {
  LoadedLibrary(std::string library_name, MtlFile library_file);
  /// `name` as an OBJ uses it; what follows a blank and # may be a comment, here and in the library. nullptr
  /// = none.
  const MtlMaterial* find(const std::string& wanted) const;

  std::string name;
  MtlFile file;
  std::map<std::string, std::size_t> by_name;  // the first material so named
};

struct FoundMaterial {
  const MtlMaterial* material = nullptr;  // nullptr = in no library
  const LoadedLibrary* library = nullptr;
};
FoundMaterial find_material(const std::vector<LoadedLibrary>& libraries, const std::string& name);

/// Reads the libraries that an OBJ names. What is not there gives a warning.
class LibraryLoader {
 public:
  LibraryLoader(const std::string& file, Model& model, Resolver& resolver, const ImportOptions& options);
  /// `mtllib a.mtl b.mtl` names two files, `mtllib my scan.mtl` one: the whole is tried first.
  void load(const std::string& names, std::size_t line);
  std::vector<LoadedLibrary> take() { return std::move(loaded_); }
  bool any_missing() const { return any_missing_; }

 private:
  std::string load_one(const std::string& name);
  void missing(const std::string& name, const std::string& looked_for);

  const std::string own_name_;  // of a library that is named after the model
  Model& model_;
  Resolver& resolver_;
  const std::uint64_t max_bytes_;
  std::string place_;
  std::vector<LoadedLibrary> loaded_;
  bool any_missing_ = false;
};

/// The glTF material, images added to the model. Decisions where MTL is vague:
/// - Kd and Ke are sRGB, as the viewers that made MTL common show them. Kd beside a texture follows
///   options.obj_kd.
/// - `d` is opacity. `Tr` is transparency, but opacity in files that MeshLab wrote. Tr 1 without d, literally
///   an invisible material, is opaque with a note: exporters mean that.
/// - The alpha of map_Kd is judged later (judge_alpha()). map_d becomes the alpha of map_Kd's image, blended.
/// - map_Pr and map_Pm become one image, roughness in green and metallic in blue. Where two such images do
///   not have the same -s, -o and -clamp the second is left out with a warning.
/// - map_Ks, map_Ns, disp, decal and refl have no counterpart: a warning names them.
/// - norm is a normal map. bump and map_Bump are one when the picture is the typical blue, else a height map,
///   which glTF cannot show: a note.
/// - -clamp on clamps; everything else repeats.
Material material_from_mtl(const MtlMaterial& mtl, const MtlFile& file, const std::string& mtl_name,
                           Model& model, Resolver& resolver, const ImportOptions& options);

}  // namespace texmesh
