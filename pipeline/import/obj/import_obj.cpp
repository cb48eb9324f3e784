#include "pipeline/about/source_fields.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/material_images.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/obj/obj_material.h"
#include "pipeline/import/text_scan.h"

// OBJ is read here and not by tinyobjloader 2.0rc10, which (measured on Debian 12) turns "nan", "inf" and
// words into 0 without a word, wraps the index 99999999999 onto another vertex, gives a polygon of 300
// corners as one of 44, cuts `usemtl my mat` to "my", and rounds 59 % of nine-digit decimals wrongly through
// libm's pow, whose bits differ between machines.
//
// Read: v (with w ignored, with r g b), vt, vn, f and fo with negative indices and polygons, o and g (parts),
// usemtl, mtllib, continued lines. Other statements (lines, points, curves, smoothing groups) are counted or
// ignored. v runs upwards in OBJ and downwards in glTF: v' = 1 - v. Vertex colours are sRGB, 0..1 or 0..255.

namespace texmesh {
namespace {

struct ObjCorner {
  std::uint32_t position = 0, uv = kNoIndex, normal = kNoIndex;
};

struct ObjFace {
  std::uint64_t begin = 0;  // of its corners
  std::uint32_t line = 0;
  std::uint16_t material = 0, part = 0;
};

/// The statements of an OBJ as they stand.
struct ObjData {
  std::vector<Vec3d> positions;
  std::vector<Vec3f> colours;  // as written; empty or one per position, NaN where a vertex has none
  std::vector<Vec2f> uvs;      // v flipped
  std::vector<Vec3f> normals;
  std::vector<ObjCorner> corners;
  std::vector<ObjFace> faces;
  std::vector<std::string> materials, parts;  // by first use; materials[0] is "" (before any usemtl)
  std::vector<std::uint16_t> tiles;  // per material: the UDIM tile that it stands for, 0 = none; or empty
  std::vector<std::size_t> with_bump_map;  // materials that name one and no normal map
  struct Library {
    std::string name;
    std::size_t line;
  };
  std::vector<Library> libraries;
  std::vector<bool> flat;                               // per face: `s off`; empty where nothing is
  std::vector<Vec3f> zbrush_colours;                    // one per position, 0..255, where their number fits
  std::uint64_t small_faces = 0, lines_and_points = 0;  // left out
  std::uint64_t zero_indices = 0;                       // of normals and texture coordinates: there is none
  std::uint64_t far_indices = 0;   // of normals and texture coordinates that are not there
  std::uint64_t broken_faces = 0;  // left out: a vertex of theirs is not there
  std::uint32_t broken_line = 0;   // of the first one
  Lost unread;                     // statements, by their first word
  bool parts_full = false;         // the last part stands for all further ones
  std::uint16_t tile(std::size_t material) const {
    return tiles.empty() ? std::uint16_t{0} : tiles[material];
  }
  std::span<const ObjCorner> corners_of(std::size_t f) const {
    const std::uint64_t end = f + 1 < faces.size() ? faces[f + 1].begin : corners.size();
    return {corners.data() + faces[f].begin, static_cast<std::size_t>(end - faces[f].begin)};
  }
};

constexpr std::int64_t kMaxIndex = 2'000'000'000;
constexpr std::uint32_t kNowhere = kNoIndex - 1;  // an index that can mean nothing
constexpr std::size_t kMaxNames = 65535;          // parts, materials
constexpr std::size_t kMaxStatementBytes = 24;

/// Names to numbers by first use.
class NameTable {
 public:
  std::uint16_t number_of(const std::string& name, std::vector<std::string>& names, bool& full) {
    const auto [it, is_new] = numbers_.try_emplace(name, static_cast<std::uint16_t>(names.size()));
    if (!is_new) return it->second;
    if (names.size() >= kMaxNames) {
      numbers_.erase(it);
      full = true;
      return static_cast<std::uint16_t>(kMaxNames - 1);
    }
    names.push_back(name);
    return it->second;
  }

 private:
  std::map<std::string, std::uint16_t> numbers_;
};

class ObjReader {
 public:
  ObjReader(const std::string& file, std::string_view text, const ImportOptions& options,
            const RunContext& context)
      : file_(file), lines_(text), options_(options), context_(context) {}

  ObjData read() {
    material_ = material_numbers_.number_of("", data_.materials, materials_full_);
    part_ = part_numbers_.number_of("", data_.parts, data_.parts_full);
    std::string_view line;
    while (lines_.next(line)) {
      if (lines_.number() % 65536 == 0) context_.check_cancelled();
      if (!line.empty() && line.back() == '\\') line = continued(line);
      statement(line);
    }
    drop_broken_references();
    if (data_.colours.empty() && data_.zbrush_colours.size() == data_.positions.size())
      data_.colours.swap(data_.zbrush_colours);
    return std::move(data_);
  }

 private:
  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw InputError(file_, lines_.place(), std::move(expected), std::move(found));
  }

  // A backslash at the end of a line joins the next one.
  std::string_view continued(std::string_view line) {
    joined_.clear();
    for (;;) {
      const bool more = !line.empty() && line.back() == '\\';
      joined_.append(more ? line.substr(0, line.size() - 1) : line);
      if (!more || !lines_.next(line)) return joined_;
      joined_ += ' ';
    }
  }

  void statement(std::string_view rest) {
    const std::string_view word = next_token(rest);
    if (word.empty() || (word[0] != '#' && read_statement(word, rest))) return;
    if (word[0] == '#') return word == "#MRGB" ? zbrush_colours(trim(rest)) : void();
    const std::string small = lower(word);
    if (small == word || !read_statement(small, rest))
      count_lost(data_.unread, small.substr(0, kMaxStatementBytes));
  }

  /// False for a statement that is not known.
  bool read_statement(std::string_view word, std::string_view rest) {
    if (word == "v")
      vertex(rest);
    else if (word == "vt")
      texture_coordinate(rest);
    else if (word == "vn")
      normal(rest);
    else if (word == "f" || word == "fo")
      face(rest);
    else if (word == "usemtl")
      use_material(std::string(trim(rest)));
    else if (word == "o")
      name_part(object_, rest);
    else if (word == "g")
      name_part(group_, rest);
    else if (word == "mtllib")
      data_.libraries.push_back({std::string(trim(rest)), lines_.number()});
    else if (word == "l" || word == "p")
      ++data_.lines_and_points;
    else if (word == "s")
      smoothing(next_token(rest));
    else
      return false;
    return true;
  }

  void smoothing(std::string_view group) { is_flat_ = group == "0" || same_word(group, "off"); }

  // ZBrush: a mask and a colour per vertex, eight hexadecimal digits each, many in a comment.
  void zbrush_colours(std::string_view digits) {
    for (;
         digits.size() >= 8 && data_.zbrush_colours.size() < static_cast<std::size_t>(options_.max_vertices);
         digits.remove_prefix(8)) {
      std::uint32_t value = 0;
      const auto end = std::from_chars(digits.data(), digits.data() + 8, value, 16);
      if (end.ec != std::errc() || end.ptr != digits.data() + 8) return;
      data_.zbrush_colours.push_back({static_cast<float>(value >> 16 & 255),
                                      static_cast<float>(value >> 8 & 255), static_cast<float>(value & 255)});
    }
  }

  // Up to `most` numbers; stops at a comment.
  int numbers(std::string_view rest, double* out, int most) const {
    int n = 0;
    for (std::string_view token = next_token(rest); !token.empty() && token[0] != '#' && n < most;
         token = next_token(rest), ++n)
      if (!parse_number(token, out[n])) fail("a number", quote(token));
    return n;
  }

  void check_count(std::size_t n, const char* what) const {
    if (n >= static_cast<std::size_t>(options_.max_vertices))
      fail("at most " + std::to_string(options_.max_vertices) + " " + what, "more");
  }

  void vertex(std::string_view rest) {
    double x[8];
    const int n = numbers(rest, x, 8);
    if (n < 3) fail("v and three numbers", std::to_string(n));
    check_count(data_.positions.size(), "vertices");
    data_.positions.push_back({x[0], x[1], x[2]});
    // x y z r g b, also with a or with w before; x y z w has no colour.
    const bool has_colour = n >= 6;
    if (!has_colour && data_.colours.empty()) return;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    data_.colours.resize(data_.positions.size() - 1, {nan, nan, nan});
    data_.colours.push_back(has_colour ? to_float(Vec3d{x[3], x[4], x[5]}) : Vec3f{nan, nan, nan});
  }

  void texture_coordinate(std::string_view rest) {
    double x[3] = {0, 0, 0};
    const int n = numbers(rest, x, 3);
    if (n < 1) fail("vt and a number", "none");
    check_count(data_.uvs.size(), "texture coordinates");
    data_.uvs.push_back({static_cast<float>(x[0]), static_cast<float>(1 - x[1])});
  }

  void normal(std::string_view rest) {
    double x[3];
    if (numbers(rest, x, 3) != 3) fail("vn and three numbers", "fewer");
    check_count(data_.normals.size(), "normals");
    data_.normals.push_back(to_float(Vec3d{x[0], x[1], x[2]}));
  }

  // 1 is the first, -1 the latest. Indices may run ahead of what they mean: drop_broken_references() has the
  // last word, and on those that can mean nothing, too.
  std::uint32_t index(std::string_view token, std::size_t count) const {
    std::int64_t i = 0;
    if (!parse_integer(token, i)) fail("a face corner such as 3, 3/1 or 3/1/2", quote(token));
    if (i < 0) i += static_cast<std::int64_t>(count) + 1;
    return i < 1 || i > kMaxIndex ? kNowhere : static_cast<std::uint32_t>(i - 1);
  }

  /// Cinema 4D writes 0 for "none".
  std::uint32_t index_or_none(std::string_view token, std::size_t count) {
    if (token != "0") return index(token, count);
    ++data_.zero_indices;
    return kNoIndex;
  }

  ObjCorner corner(std::string_view token) {
    ObjCorner r;
    const std::size_t slash = token.find('/');
    r.position = index(token.substr(0, slash), data_.positions.size());
    if (slash == std::string_view::npos) return r;
    token.remove_prefix(slash + 1);
    const std::size_t second = token.find('/');
    if (second != 0 && !token.empty()) r.uv = index_or_none(token.substr(0, second), data_.uvs.size());
    if (second == std::string_view::npos) return r;
    token.remove_prefix(second + 1);
    if (!token.empty()) r.normal = index_or_none(token, data_.normals.size());
    return r;
  }

  void face(std::string_view rest) {
    const std::size_t begin = data_.corners.size();
    for (std::string_view token = next_token(rest); !token.empty() && token[0] != '#';
         token = next_token(rest))
      data_.corners.push_back(corner(token));
    if (data_.corners.size() - begin < 3) {
      data_.corners.resize(begin);
      ++data_.small_faces;
      return;
    }
    if (data_.faces.size() >= static_cast<std::size_t>(options_.max_triangles))
      fail("at most " + std::to_string(options_.max_triangles) + " triangles", "more");
    data_.faces.push_back({begin,
                           static_cast<std::uint32_t>(std::min<std::size_t>(lines_.number(), kNoIndex)),
                           material_, part_});
    if (!is_flat_ && data_.flat.empty()) return;
    data_.flat.resize(data_.faces.size() - 1);
    data_.flat.push_back(is_flat_);
  }

  void use_material(const std::string& name) {
    material_ = material_numbers_.number_of(name, data_.materials, materials_full_);
    if (materials_full_) fail("at most " + std::to_string(kMaxNames) + " materials", "more");
  }

  void name_part(std::string& slot, std::string_view rest) {
    slot = trim(rest);
    if (&slot == &object_) group_.clear();
    const bool both = !object_.empty() && !group_.empty() && object_ != group_;
    part_ = part_numbers_.number_of(both              ? object_ + "/" + group_
                                    : object_.empty() ? group_
                                                      : object_,
                                    data_.parts, data_.parts_full);
  }

  /// Faces with a vertex that is not there go; a corner whose texture coordinate or normal is not there goes
  /// without.
  void drop_broken_references() {
    const auto keep = [this](std::uint32_t& i, std::size_t count) {
      if (i == kNoIndex || i < count) return;
      i = kNoIndex;
      ++data_.far_indices;
    };
    for (ObjCorner& r : data_.corners) keep(r.uv, data_.uvs.size()), keep(r.normal, data_.normals.size());
    const auto is_there = [this](const ObjCorner& r) { return r.position < data_.positions.size(); };
    std::size_t kept = 0;
    std::uint64_t corners = 0;
    for (std::size_t f = 0; f < data_.faces.size(); ++f) {
      const std::span<const ObjCorner> of = data_.corners_of(f);
      if (!std::all_of(of.begin(), of.end(), is_there)) {
        if (data_.broken_faces++ == 0) data_.broken_line = data_.faces[f].line;
        continue;
      }
      ObjFace face = data_.faces[f];
      face.begin = corners;
      for (const ObjCorner& r : of) data_.corners[corners++] = r;
      if (!data_.flat.empty()) data_.flat[kept] = f < data_.flat.size() && data_.flat[f];
      data_.faces[kept++] = face;
    }
    if (data_.broken_faces == 0) return;
    if (kept == 0)
      throw InputError(file_, "line " + std::to_string(data_.broken_line),
                       "a face of the " + std::to_string(data_.positions.size()) + " vertices", "none");
    data_.faces.resize(kept);
    data_.corners.resize(corners);
    if (!data_.flat.empty()) data_.flat.resize(kept);
  }

  const std::string& file_;
  LineReader lines_;
  const ImportOptions& options_;
  const RunContext& context_;
  ObjData data_;
  NameTable material_numbers_, part_numbers_;
  std::string object_, group_, joined_;
  std::uint16_t material_ = 0, part_ = 0;
  bool materials_full_ = false, is_flat_ = false;
};

ObjData read_obj(const std::string& file, std::string_view text, const ImportOptions& options,
                 const RunContext& context) {
  return ObjReader(file, text, options, context).read();
}

// The materials that a file names.

/// The UDIM tile that a face lies in.
std::uint16_t tile_of(const ObjData& data, std::size_t face) {
  Vec2d sum;
  const std::span<const ObjCorner> corners = data.corners_of(face);
  for (const ObjCorner& r : corners)
    if (r.uv != kNoIndex) sum = sum + to_double(data.uvs[r.uv]);
  return tile_at(sum * (1 / static_cast<double>(corners.size())));
}

/// Per material: whether its maps are named after tiles.
std::vector<bool> find_tiled(const ObjData& data, const std::vector<LoadedLibrary>& libraries,
                             Resolver& resolver, const ImportOptions& options) {
  std::vector<bool> tiled(data.materials.size());
  std::vector<std::set<std::uint16_t>> tiles(data.materials.size());
  for (std::size_t f = 0; f < data.faces.size(); ++f) tiles[data.faces[f].material].insert(tile_of(data, f));
  for (std::size_t m = 0; m < data.materials.size(); ++m)
    if (const auto [material, library] = find_material(libraries, data.materials[m]); material)
      for_each_map(*material, [&, from = library](const std::string& file) {
        const TileMark mark = tile_mark(file);
        tiled[m] = tiled[m] || mark == TileMark::kWord ||
                   (mark == TileMark::kNumber &&
                    other_tile_is_there({file, from->name, false}, tiles[m], resolver, options));
      });
  return tiled;
}

/// Faces of a material whose maps are named after tiles come to have one of each tile.
void split_into_tiles(ObjData& data, const std::vector<bool>& tiled, const std::string& file, Notes& notes) {
  if (std::find(tiled.begin(), tiled.end(), true) == tiled.end()) return;
  data.tiles.resize(data.materials.size());
  std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint16_t> made;
  std::size_t left_out = 0;
  for (std::size_t f = 0; f < data.faces.size(); ++f) {
    std::uint16_t& material = data.faces[f].material;
    if (material >= tiled.size() || !tiled[material]) continue;
    const std::uint16_t tile = tile_of(data, f);
    auto [it, is_new] = made.try_emplace({material, tile}, static_cast<std::uint16_t>(data.materials.size()));
    if (is_new && data.materials.size() >= kMaxNames) it->second = material, ++left_out;
    if (is_new && data.materials.size() < kMaxNames) {
      data.materials.push_back(data.materials[material]);
      data.tiles.push_back(tile);
    }
    material = it->second;
  }
  warn_of_tiles(notes, file, made.size(), left_out);
}

/// Where faces name one material, or none, and the libraries have one, of another name: who renames a
/// material in one of two files means it.
void take_only_material(ObjData& data, const std::vector<LoadedLibrary>& libraries, const std::string& file,
                        Notes& notes) {
  if (libraries.size() != 1 || libraries[0].file.materials.size() != 1) return;
  const std::uint16_t used = data.faces[0].material;
  const auto is_used = [used](const ObjFace& f) { return f.material == used; };
  std::string& name = data.materials[used];
  const std::string& only = libraries[0].file.materials[0].name;
  if (libraries[0].find(name) || !std::ranges::all_of(data.faces, is_used)) return;
  add_warning(notes, "other-material", file,
              (name.empty() ? "faces name no material" : "material " + quote(name) + " is in no library") +
                  "; " + quote(only) + ", the only one of " + quote(libraries[0].name) + ", is taken");
  name = only;
}

/// "are "skin", "base" and 3 more".
std::string names_of_materials(const std::vector<LoadedLibrary>& libraries) {
  constexpr std::size_t kMostTold = 3;
  std::string text;
  std::size_t count = 0;
  for (const LoadedLibrary& library : libraries)
    for (const MtlMaterial& material : library.file.materials)
      if (count++ < kMostTold) text += (text.empty() ? "are " : ", ") + quote(material.name);
  if (count > kMostTold) text += " and " + std::to_string(count - kMostTold) + " more";
  return text.empty() ? "are none" : text;
}

Material make_material(const std::string& name, std::uint16_t tile,
                       const std::vector<LoadedLibrary>& libraries, bool any_library, const std::string& file,
                       Model& model, Resolver& resolver, const ImportOptions& options) {
  if (const auto [material, library] = find_material(libraries, name); material)
    return material_from_mtl(tile == 0 ? *material : of_tile(*material, tile), library->file, library->name,
                             model, resolver, options);
  if (!libraries.empty())
    add_warning(
        model.notes, "missing-material", file,
        "material " + quote(name) + " is in no material library; there " + names_of_materials(libraries));
  else if (!any_library)
    add_warning(model.notes, "missing-material", file,
                "material " + quote(name) + " is used but no mtllib names a library");
  return scan_material(name);
}

/// Adds a material to the model for each name in data.materials, in order, from the libraries that the file
/// names. What is missing gives a warning and a material without texture.
void add_obj_materials(ObjData& data, const std::string& file, Model& model, Resolver& resolver,
                       const ImportOptions& options, Lost& lost) {
  LibraryLoader loader(file, model, resolver, options);
  for (const ObjData::Library& library : data.libraries) {
    const auto same = [&library](const ObjData::Library& other) { return other.name == library.name; };
    const auto first = std::find_if(data.libraries.begin(), data.libraries.end(), same);
    if (&*first == &library) loader.load(library.name, library.line);
  }
  const std::vector<LoadedLibrary> libraries = loader.take();
  for (const LoadedLibrary& library : libraries)
    for (const auto& [word, count] : library.file.unread)
      lost["statements " + quote(word) + " of materials"] += count;
  if (!loader.any_missing()) take_only_material(data, libraries, file, model.notes);
  split_into_tiles(data, find_tiled(data, libraries, resolver, options), file, model.notes);
  std::vector<std::uint8_t> used(data.materials.size(), 0);
  for (const ObjFace& f : data.faces) used[f.material] = 1;
  if (used[0] && data.materials[0].empty() && !libraries.empty())
    add_warning(model.notes, "missing-material", file,
                "faces name no material (usemtl); there " + names_of_materials(libraries));
  for (std::size_t i = 0; i < data.materials.size(); ++i) {
    // Textures of materials without faces are never asked for.
    const bool named = used[i] && !(i == 0 && data.materials[0].empty());
    model.materials.push_back(named ? make_material(data.materials[i], data.tile(i), libraries,
                                                    !data.libraries.empty(), file, model, resolver, options)
                                    : scan_material(i == 0 ? "untextured" : data.materials[i]));
    const MtlMaterial* material = find_material(libraries, data.materials[i]).material;
    if (named && material && !material->norm && material->bump) data.with_bump_map.push_back(i);
  }
  const auto only = std::find(used.begin(), used.end(), 1);
  if (libraries.empty() && !data.uvs.empty() && data.colours.empty() && std::count(only, used.end(), 1) == 1)
    model.materials[static_cast<std::size_t>(only - used.begin())].base_colour_texture.image =
        add_unnamed_texture(model, resolver, file, "", options);
}

// The mesh.

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
bool choose_colours(const ObjData& data, Model& model, const ImportOptions& options, Lost& lost) {
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
  if (beside_texture) ++lost["vertex colours beside a texture"];
  if (beside_texture)
    add_info(model.notes, "colours-beside-texture", "", "vertex colours are left out where a texture shows");
  for (std::size_t m = 0; m < coloured.size(); ++m)
    if (coloured[m] && options.obj_kd == KdPolicy::kIgnore)
      model.materials[m].base_colour = {1, 1, 1, model.materials[m].base_colour.w};
  return any;
}

/// Normals for a file without any where `s off` stands before some of its faces: those are flat.
class MadeNormals {
 public:
  explicit MadeNormals(const ObjData& data) : data_(data), smooth_(data.positions.size()) {
    for (std::size_t f = 0; f < data.faces.size(); ++f)
      for (const ObjCorner& r : data.corners_of(f))
        if (!data.flat[f]) smooth_[r.position] = smooth_[r.position] + of_face(f);
  }
  Vec3f of(std::size_t face, std::uint32_t position) const {
    return to_float(normalized(data_.flat[face] ? of_face(face) : smooth_[position]));
  }

 private:
  Vec3d of_face(std::size_t face) const {
    const std::span<const ObjCorner> corners = data_.corners_of(face);
    const Vec3d first = data_.positions[corners[0].position];
    Vec3d sum;
    for (std::size_t k = 1; k + 1 < corners.size(); ++k)
      sum = sum + cross(data_.positions[corners[k].position] - first,
                        data_.positions[corners[k + 1].position] - first);
    return sum;
  }
  const ObjData& data_;
  std::vector<Vec3d> smooth_;  // per position
};

/// All of them are: then none has to be written, as in glTF.
bool is_all_flat(const ObjData& data) {
  const auto is_flat = [](bool flat) { return flat; };
  return !data.flat.empty() && std::all_of(data.flat.begin(), data.flat.end(), is_flat);
}

Mesh build_mesh(const ObjData& data, Model& model, const ImportOptions& options, const RunContext& context,
                Lost& lost) {
  bool any_uv = false, any_normal = false;
  for (const ObjCorner& r : data.corners) {
    any_uv = any_uv || r.uv != kNoIndex;
    any_normal = any_normal || r.normal != kNoIndex;
  }
  const bool any_colour = choose_colours(data, model, options, lost);
  const double scale = scale_of_largest(data);
  std::optional<MadeNormals> made;
  if (!any_normal && !data.flat.empty() && !is_all_flat(data)) made.emplace(data);
  MeshBuilder builder(data.positions, {any_uv, any_normal || made, any_colour});
  std::vector<Corner> corners;
  std::uint64_t without_uv = 0;
  for (std::size_t f = 0; f < data.faces.size(); ++f) {
    if (f % 65536 == 0) context.check_cancelled();
    const ObjFace& face = data.faces[f];
    const bool face_textured = textured(model, face.material);
    const std::uint16_t tile = data.tile(face.material);
    Vec2f moved;  // back to the first tile
    if (tile != 0)
      moved = {static_cast<float>((tile - kFirstTile) % kTilesInARow),
               static_cast<float>((tile - kFirstTile) / kTilesInARow)};
    bool lacks_uv = false;
    corners.clear();
    for (const ObjCorner& r : data.corners_of(f)) {
      Corner c;
      c.position = r.position;
      if (r.uv != kNoIndex)
        c.uv = tile == 0 ? data.uvs[r.uv] : Vec2f{data.uvs[r.uv].x - moved.x, data.uvs[r.uv].y + moved.y};
      else
        lacks_uv = true;
      if (r.normal != kNoIndex) c.normal = data.normals[r.normal];
      if (made) c.normal = made->of(f, r.position);
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

void add_notes(const ObjData& data, Model& model, Lost& lost) {
  if (data.zero_indices)
    add_warning(model.notes, "index-0", "",
                "0 stands for the normal or texture coordinate of a corner, " +
                    std::to_string(data.zero_indices) + " times; such corners go without");
  if (data.far_indices)
    add_warning(model.notes, "index-beyond", "",
                std::to_string(data.far_indices) +
                    " corners name a normal or texture coordinate that is not there; they go without");
  if (data.broken_faces) {
    lost["faces with missing vertices"] = data.broken_faces;
    add_warning(model.notes, "broken-face", "line " + std::to_string(data.broken_line),
                std::to_string(data.broken_faces) +
                    " faces name a vertex that is not there and are left out; this is the first one");
  }
  for (const auto& [word, count] : data.unread) lost["statements " + quote(word)] += count;
  if (data.lines_and_points) lost["line and point elements"] = data.lines_and_points;
  if (!data.zbrush_colours.empty()) lost["colours of ZBrush"] = data.zbrush_colours.size();

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
  ImportedModel out;
  const SourceText text(text_of(bytes), file_name, out.model.notes);
  ObjData data = read_obj(file_name, text.text(), options, context);
  if (data.positions.empty()) throw InputError(file_name, "", "an OBJ with v statements", "none");
  if (data.faces.empty())
    throw InputError(file_name, "", "faces",
                     "none (a point cloud of " + std::to_string(data.positions.size()) + " points)");
  out.format = "obj";
  out.about = about_from_comments(obj_comments(text.text()), out.format, out.model.notes);
  add_obj_materials(data, file_name, out.model, resolver, options, out.lost);
  out.model.mesh = build_mesh(data, out.model, options, context, out.lost);
  out.model.mesh.part_names = data.parts;
  out.normals_by_specification = out.model.mesh.normals.empty() && is_all_flat(data);
  add_notes(data, out.model, out.lost);
  judge_bump_maps(out.model, data.with_bump_map, context);
  finish_scan(out.model, file_name, options, context);
  return out;
}

}  // namespace texmesh
