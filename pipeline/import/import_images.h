#pragma once
#include <set>

#include "pipeline/import/import.h"
#include "pipeline/import/named_files.h"

namespace texmesh {

/// The image that a material names (find_file()): probed and appended to model.images (one entry per
/// content), index returned. -1 and a warning "missing-texture" where it is not there, which says where it
/// was looked for, and where a Git LFS pointer, an HTML page, an archive or the like (foreign_file()) is in
/// its place. Content that no allow-listed reader takes throws InputError. A KTX2 becomes a PNG with a note
/// (stages/image/ktx2/read_ktx2.h). Notes say what becomes of colour profiles, CMYK and EXIF orientation.
std::int32_t add_image(Model& model, const NameInModel& name, Resolver& resolver,
                       const std::string& file_name, const std::string& place, const ImportOptions& options);
/// The picture that is named after something: `stem` with any ending of pictures, as find_file() finds it. -1
/// and nothing said where there is none; an image's `name` is the file's.
std::int32_t add_image_of_stem(Model& model, const std::string& stem, Resolver& resolver,
                               const std::string& file_name, const std::string& place,
                               const ImportOptions& options);
/// The texture of a model that has texture coordinates and names no texture: the picture that is named after
/// the model, with the warning "unnamed-texture".
std::int32_t add_unnamed_texture(Model& model, Resolver& resolver, const std::string& file_name,
                                 const std::string& place, const ImportOptions& options);
std::int32_t add_image_bytes(Model& model, std::string name, std::vector<std::uint8_t> bytes,
                             const std::string& file_name, const std::string& place,
                             const ImportOptions& options);

/// UDIM: a texture of several pictures, one for each whole repeat (tile) of the texture coordinates. Tile
/// 1001 + u + 10 v holds coordinates from (u, v) on, v upwards.
inline constexpr std::uint16_t kFirstTile = 1001, kTilesInARow = 10, kLastTile = 9999;

/// How a name says that it has tiles: "scan.<UDIM>.png" for sure, "scan.1001.png" only where faces lie in
/// other tiles whose pictures are there.
enum class TileMark : std::uint8_t { kNone, kNumber, kWord };
TileMark tile_mark(std::string_view name);
/// The name of one tile's picture. `name` as it is where it has no mark.
std::string name_of_tile(std::string name, std::uint16_t tile);
/// The tile of texture coordinates, v downwards; the first one outside of all rows.
std::uint16_t tile_at(Vec2d uv);
/// Whether a picture of one of these tiles, the first one apart, is there.
bool other_tile_is_there(const NameInModel& name, const std::set<std::uint16_t>& tiles, Resolver& resolver,
                         const ImportOptions& options);

/// The warning where `left_out` of `tiles` tiles with faces have no material of their own, since a model has
/// at most 65,535; none for 0.
void warn_of_tiles(Notes& notes, const std::string& place, std::size_t tiles, std::size_t left_out);

/// Pictures of tiles in formats whose materials are read before it is known where faces lie.
class TiledImages {
 public:
  /// As texmesh::add_image(). Of a name with tiles it is one of them, until split().
  std::int32_t add_image(Model& model, const NameInModel& name, Resolver& resolver,
                         const std::string& file_name, const std::string& place,
                         const ImportOptions& options);
  /// Materials with such pictures become one for each tile that their triangles lie in. Before
  /// finish_model(). A tile that is not there is a missing texture. Warns of tiles that are too many.
  void split(Model& model, Resolver& resolver, const std::string& file_name, const ImportOptions& options);

 private:
  struct Tiled {
    std::int32_t image;  // that stands for all
    NameInModel name;
    std::string place;
  };
  const Tiled* find(const TextureRef& reference) const;
  bool has_tiles(const Material& material, const std::set<std::uint16_t>& tiles, Resolver& resolver,
                 const ImportOptions& options) const;
  Material of_tile(Material material, std::uint16_t tile, Model& model, Resolver& resolver,
                   const std::string& file_name, const ImportOptions& options) const;

  std::vector<Tiled> tiled_;
};

}  // namespace texmesh
