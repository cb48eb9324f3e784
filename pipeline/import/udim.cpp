#include "pipeline/import/udim.h"

#include <cmath>
#include <map>

#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostMaterials = 65535;

/// Where the mark stands in a name.
struct Mark {
  TileMark kind = TileMark::kNone;
  std::size_t at = 0, length = 0;
};

Mark find_mark(std::string_view name) {
  const std::string small = lower(name);
  for (const std::string_view word : {"<udim>", "%3cudim%3e"})
    if (const std::size_t at = small.rfind(word); at != small.npos) return {TileMark::kWord, at, word.size()};
  static constexpr std::string_view kNumber = "1001";
  const std::size_t at = small.rfind(kNumber), end = at + kNumber.size();
  if (at == small.npos || at == 0 || (small[at - 1] != '.' && small[at - 1] != '_') || end >= small.size() ||
      small[end] != '.')
    return {};
  return {TileMark::kNumber, at, kNumber.size()};
}

bool is_there(const NameInModel& name, std::uint16_t tile, Resolver& resolver, const ImportOptions& options) {
  Notes unsaid;
  NameInModel of = name;
  of.text = name_of_tile(name.text, tile);
  return find_file(of, resolver, static_cast<std::uint64_t>(options.max_file_bytes), unsaid, "")
      .bytes.has_value();
}

}  // namespace

void warn_of_tiles(Notes& notes, const std::string& place, std::size_t tiles, std::size_t left_out) {
  if (left_out > 0)
    add_warning(
        notes, "too-many-tiles", place,
        "faces lie in " + std::to_string(tiles) + " UDIM tiles, and a model has at most " +
            std::to_string(kMostMaterials) + " materials: " + std::to_string(left_out) +
            " tiles are shown without their own pictures. Join pictures, or compile parts of the model");
}

TileMark tile_mark(std::string_view name) { return find_mark(name).kind; }

std::string name_of_tile(std::string name, std::uint16_t tile) {
  const Mark mark = find_mark(name);
  return mark.kind == TileMark::kNone ? name : name.replace(mark.at, mark.length, std::to_string(tile));
}

std::uint16_t tile_at(Vec2d uv) {
  const double u = std::floor(uv.x), v = std::floor(1 - uv.y), tile = kFirstTile + u + kTilesInARow * v;
  return u >= 0 && u < kTilesInARow && v >= 0 && tile <= kLastTile ? static_cast<std::uint16_t>(tile)
                                                                   : kFirstTile;
}

bool other_tile_is_there(const NameInModel& name, const std::set<std::uint16_t>& tiles, Resolver& resolver,
                         const ImportOptions& options) {
  return std::any_of(tiles.begin(), tiles.end(), [&](std::uint16_t tile) {
    return tile != kFirstTile && is_there(name, tile, resolver, options);
  });
}

std::int32_t TiledImages::add_image(Model& model, const NameInModel& name, Resolver& resolver,
                                    const std::string& file_name, const std::string& place,
                                    const ImportOptions& options) {
  const TileMark mark = tile_mark(name.text);
  if (mark == TileMark::kNone) return texmesh::add_image(model, name, resolver, file_name, place, options);
  NameInModel first = name;
  if (mark == TileMark::kWord) {
    constexpr std::uint16_t kSearched = kFirstTile + 10 * kTilesInARow;
    std::uint16_t tile = kFirstTile;
    while (tile < kSearched && !is_there(name, tile, resolver, options)) ++tile;
    first.text = name_of_tile(name.text, tile == kSearched ? kFirstTile : tile);
  }
  const std::int32_t image = texmesh::add_image(model, first, resolver, file_name, place, options);
  if (image >= 0) tiled_.push_back({image, name, place});
  return image;
}

const TiledImages::Tiled* TiledImages::find(const TextureRef& reference) const {
  const auto is_it = [&](const Tiled& t) { return t.image == reference.image; };
  const auto at = std::find_if(tiled_.begin(), tiled_.end(), is_it);
  return reference.used() && at != tiled_.end() ? &*at : nullptr;
}

bool TiledImages::has_tiles(const Material& material, const std::set<std::uint16_t>& tiles,
                            Resolver& resolver, const ImportOptions& options) const {
  bool any = false;
  for_each_texture(material, [&](const TextureRef& r) {
    const Tiled* of = find(r);
    any = any || (of && (tile_mark(of->name.text) == TileMark::kWord ||
                         other_tile_is_there(of->name, tiles, resolver, options)));
  });
  return any;
}

Material TiledImages::of_tile(Material material, std::uint16_t tile, Model& model, Resolver& resolver,
                              const std::string& file_name, const ImportOptions& options) const {
  material.name += "." + std::to_string(tile);
  for_each_texture(material, [&](TextureRef& r) {
    const Tiled* of = find(r);
    if (!of) return;
    NameInModel name = of->name;
    name.text = name_of_tile(name.text, tile);
    r.image = texmesh::add_image(model, name, resolver, file_name, of->place, options);
    r.wrap_s = r.wrap_t = Wrap::kRepeat;  // the coordinates stay in their tile
    if (!r.used()) r = {};
  });
  return material;
}

void TiledImages::split(Model& model, Resolver& resolver, const std::string& file_name,
                        const ImportOptions& options) {
  if (tiled_.empty()) return;
  Mesh& mesh = model.mesh;
  const std::size_t materials = model.materials.size();
  std::vector<const std::vector<Vec2f>*> uvs(materials, nullptr);  // of the material's first such texture
  for (std::size_t m = 0; m < materials; ++m)
    for_each_texture(model.materials[m], [&](const TextureRef& r) {
      const std::vector<Vec2f>& of = r.texcoord == 0 ? mesh.uv0 : mesh.uv1;
      if (!uvs[m] && find(r) && !of.empty()) uvs[m] = &of;
    });
  const auto tile_of = [&](std::size_t t) {
    Vec2d sum;
    for (const std::uint32_t w : mesh.triangles[t])
      sum = sum + to_double((*uvs[mesh.triangle_material[t]])[w]);
    return tile_at(sum * (1 / 3.0));
  };
  std::vector<std::set<std::uint16_t>> tiles(materials);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (uvs[mesh.triangle_material[t]]) tiles[mesh.triangle_material[t]].insert(tile_of(t));
  std::map<std::pair<std::size_t, std::uint16_t>, std::uint16_t> made;
  std::size_t all = 0;
  for (std::size_t m = 0; m < materials; ++m) {
    if (!has_tiles(model.materials[m], tiles[m], resolver, options)) continue;
    const Material whole = model.materials[m];
    all += tiles[m].size();
    for (const std::uint16_t tile : tiles[m]) {
      if (model.materials.size() >= kMostMaterials) break;
      Material material = of_tile(whole, tile, model, resolver, file_name, options);
      const bool is_first = tile == *tiles[m].begin();  // takes the place of the whole
      made[{m, tile}] = static_cast<std::uint16_t>(is_first ? m : model.materials.size());
      if (is_first)
        model.materials[m] = std::move(material);
      else
        model.materials.push_back(std::move(material));
    }
  }
  warn_of_tiles(model.notes, file_name, all, all - made.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::uint16_t& material = mesh.triangle_material[t];
    if (!uvs[material]) continue;
    if (const auto at = made.find({material, tile_of(t)}); at != made.end()) material = at->second;
  }
}

}  // namespace texmesh
