#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/fields.h"
#include "format/documents/about.h"
#include "format/model/model.h"
#include "pipeline/io/resolver.h"
#include "stages/base/run_context.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kImportVersion = 17;

enum class KdPolicy : std::uint8_t { kIgnore, kMultiply };
template <>
struct EnumNames<KdPolicy> {
  static constexpr std::array<std::string_view, 2> names{"ignore", "multiply"};
};
enum class UpAxis : std::uint8_t { kAuto, kKeep, kX, kY, kZ };
template <>
struct EnumNames<UpAxis> {
  static constexpr std::array<std::string_view, 5> names{"auto", "keep", "x", "y", "z"};
};

enum class ProfilePolicy : std::uint8_t { kAuto, kHonour, kIgnore };
template <>
struct EnumNames<ProfilePolicy> {
  static constexpr std::array<std::string_view, 3> names{"auto", "honour", "ignore"};
};

struct ImportOptions {
  int max_vertices = 50'000'000;  // positions, and wedges
  int max_triangles = 100'000'000;
  int max_images = 4096;
  double max_file_bytes = 8e9;  // of one file
  double max_image_pixels = 4e8;
  KdPolicy obj_kd = KdPolicy::kIgnore;
  UpAxis up = UpAxis::kAuto;
  ProfilePolicy colour_profiles = ProfilePolicy::kAuto;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("max_vertices", s.max_vertices, Range{3, 2e9}, "refuse models with more vertices");
    v("max_triangles", s.max_triangles, Range{1, 2e9}, "refuse models with more triangles");
    v("max_images", s.max_images, Range{0, 65535}, ProfileOnly{}, "refuse models with more images");
    v("max_file_bytes", s.max_file_bytes, Range{1, 1e12}, "refuse larger files");
    v("max_image_pixels", s.max_image_pixels, Range{1, 4e9}, "refuse larger images");
    v("obj_kd", s.obj_kd,
      "OBJ: Kd beside map_Kd is ignored (as in MeshLab, Blender) or multiplied (as the MTL text says)");
    v("colour_profiles", s.colour_profiles,
      "ICC profiles and gamma of textures are converted to sRGB: auto = except in glTF, whose specification "
      "says that they are ignored");
    v("up", s.up,
      "up axis of the source, turned to y: auto = what the source says, else for OBJ, PLY and STL a guess by a flat "
      "bottom, which is told; keep = as it is");
  }
};

/// What a reader has left out, by what it is ("animations", "statements vp"), with its number.
using Lost = std::map<std::string, std::uint64_t>;
/// The code of the note that says so: one a model, shown without --verbose.
inline constexpr const char* kLostNote = "left-out";

/// The code of the note that says why the model was turned, shown without --verbose.
inline constexpr const char* kTurnedNote = "turned-up";

struct ImportedModel {
  Model model;
  /// What the source's format says about meshes without normals (glTF: flat), for ConditionOptions::normals.
  bool normals_by_specification = false;
  std::string format;  // "glb", "gltf", "obj", "ply", "stl", "range"
  About about;         // what the source says about itself; unit and up axis as ImportOptions leave them
  Lost lost;           // import_model() puts it into the notes and into about.source; not archived
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.model, s.normals_by_specification, s.format, s.about);
  }
};

/// Reads a model. The format follows the content (GLB, PLY and STL magic) and then the extension of
/// `file_name`; see the readers below. Pure: bytes and resolver in, model out. Hard faults throw
/// InputError{file_name, place, expected, found}; softer ones (a missing texture, some NaN positions) are
/// notes of Model.
ImportedModel import_model(const std::string& file_name, std::span<const std::uint8_t> bytes,
                           Resolver& resolver, const ImportOptions& options, const RunContext& context);

/// Triangles that a model file says it has, at least, without reading its meshes: from the JSON of a GLB, the
/// header of a PLY, the size of a binary STL and the face lines of an OBJ. 0 where the file says nothing, or
/// more than its bytes could hold (the import finds out what is wrong).
std::uint64_t count_triangles(const std::string& file_name, std::span<const std::uint8_t> bytes);

/// .gltf and .glb.
ImportedModel import_gltf(const std::string& file_name, std::span<const std::uint8_t> bytes,
                          Resolver& resolver, const ImportOptions& options, const RunContext& context);
/// A .glb of a package, or one made of it. Whatever compiles is read whole: on its grid a position may lie
/// farther out than any that the readers of sources take.
ImportedModel import_package_glb(const std::string& file_name, std::span<const std::uint8_t> bytes,
                                 Resolver& resolver, const RunContext& context);
ImportedModel import_obj(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         Resolver& resolver, const ImportOptions& options, const RunContext& context);
ImportedModel import_ply(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         Resolver& resolver, const ImportOptions& options, const RunContext& context);
ImportedModel import_stl(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         const ImportOptions& options, const RunContext& context);
/// `bytes` is the JSON that describes a cylindrical range scan (schemas/range-scan.v1.schema.json) or a
/// Cyberware-style file; the grid image and the texture come through the resolver.
ImportedModel import_range_scan(const std::string& file_name, std::span<const std::uint8_t> bytes,
                                Resolver& resolver, const ImportOptions& options, const RunContext& context);

}  // namespace texmesh
