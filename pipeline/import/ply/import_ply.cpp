#include "pipeline/about/source_fields.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/ply/ply_reader.h"

// PLY has no specification of names beyond x, y, z. This is what MeshLab, CloudCompare, Metashape, Blender
// and VTK write, and what is read here:
//   vertex     x y z; nx ny nz; s t | u v | texture_u texture_v | texcoord_u texcoord_v;
//              red green blue alpha | r g b a | diffuse_red ...
//   face       vertex_indices | vertex_index; texcoord (u v per corner); texnumber;
//              red green blue alpha (of the whole face)
//   tristrips  vertex_indices; -1 ends a strip
//   comment TextureFile NAME: one per texture, in texnumber's order
//   multi_texture_vertex (tx u v), multi_texture_face (tx tn texture_vertex_indices) of Artec Studio: tx is
//              the texture, and the latter go with the faces in order; without comments the textures are
//              STEM_0.jpg, STEM_1.jpg ...
// What else stands in a file is counted and said.
// Names of properties may be written in any case. UVs run upwards as in OBJ. Colours are sRGB, integers in
// the range of their type and floats in 0..1, or where one is far larger in 0..255. Colours beside a texture
// are a second record of the same surface: as in MeshLab, the texture shows and the colours do not.

namespace texmesh {
namespace {

// What the vertices and faces of a file say, before a mesh is made of them.

struct PlyVertices {
  std::vector<Vec3d> positions;
  std::vector<Vec2f> uv;  // each empty or one per position
  std::vector<Vec3f> normals;
  std::vector<Vec4f> colours;
};

/// Faces as they stand in the file; corners of face f are begin[f] .. begin[f + 1].
struct PlyFaces {
  std::vector<std::size_t> begin{0};
  std::vector<std::uint32_t> index;   // of vertices; some may not be there
  std::vector<Vec2f> uv;              // per corner, or empty
  std::vector<std::uint8_t> has_uv;   // per face, or empty
  std::vector<Vec4f> colours;         // per corner, or empty
  std::vector<std::int32_t> texture;  // per face, or empty
  std::size_t count() const { return begin.size() - 1; }
};

struct PlySurface {
  PlyVertices vertices;
  PlyFaces faces;
  std::vector<std::string> comments;  // of the header, in order
  std::int32_t artec_textures = 0;    // that multi_texture_face names
  Lost lost;
  // Faults that are passed over, with their numbers:
  std::uint64_t long_lines = 0, odd_texcoords = 0;
  std::string first_long_line;  // where it stands
  std::size_t end = 0;          // of the last row that the header declares
};

double scale_of_type(PlyType type) {
  switch (type) {
    case PlyType::kFloat:
    case PlyType::kDouble:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 1 / 65535.0;
    default:
      return 1 / 255.0;  // int too: the range of the type would leave everything black
  }
}

/// Where an element keeps red, green, blue and alpha.
struct ColourColumns {
  std::array<int, 4> column{-1, -1, -1, -1};
  std::array<double, 4> scale{1, 1, 1, 1};
  std::array<float, 256> table{};  // linear light of an 8-bit value

  explicit ColourColumns(const PlyElement& element) {
    column = {element.find_property({"red", "r", "diffuse_red"}),
              element.find_property({"green", "g", "diffuse_green"}),
              element.find_property({"blue", "b", "diffuse_blue"}),
              element.find_property({"alpha", "a", "diffuse_alpha"})};
    for (std::size_t i = 0; i < 4; ++i) {
      if (column[i] < 0) continue;
      const PlyProperty& p = element.properties[static_cast<std::size_t>(column[i])];
      if (p.is_list) column[i] = -1;
      scale[i] = scale_of_type(p.type);
    }
    for (std::size_t i = 0; i < 256; ++i) table[i] = linear_from_srgb(static_cast<double>(i) / 255.0);
    if (!any()) column.fill(-1);
  }
  bool is_float() const { return any() && scale[0] == 1; }
  bool any() const { return column[0] >= 0 && column[1] >= 0 && column[2] >= 0; }
  /// Floats stay as they are until the largest is known: to_linear().
  float linear(double value, double unit) const {
    if (unit == 1) return static_cast<float>(value);
    if (unit == 1 / 255.0 && value >= 0 && value <= 255 && value == std::floor(value))
      return table[static_cast<std::size_t>(value)];
    return linear_from_srgb(value * unit);
  }
  Vec4f read(const PlyRow& row) const {
    auto value = [&](std::size_t i) { return row.values[static_cast<std::size_t>(column[i])]; };
    return {linear(value(0), scale[0]), linear(value(1), scale[1]), linear(value(2), scale[2]),
            column[3] >= 0 ? static_cast<float>(value(3) * scale[3]) : 1.0f};
  }
  /// Floats of one element, as read: sRGB in 0..1, or in 0..255 where one is far beyond 1.
  static void to_linear(std::span<Vec4f> colours) {
    constexpr float kLargestOvershoot = 16;
    float largest = 0;
    for (const Vec4f& c : colours) largest = std::max({largest, c.x, c.y, c.z});
    const double unit = largest > kLargestOvershoot ? 1 / 255.0 : 1;
    for (Vec4f& c : colours)
      c = {linear_from_srgb(c.x * unit), linear_from_srgb(c.y * unit), linear_from_srgb(c.z * unit),
           c.w > 1 ? static_cast<float>(c.w * unit) : c.w};
  }
};

int find_scalar(const PlyElement& e, std::initializer_list<std::string_view> names) {
  const int i = e.find_property(names);
  return i >= 0 && !e.properties[static_cast<std::size_t>(i)].is_list ? i : -1;
}
int find_list(const PlyElement& e, std::initializer_list<std::string_view> names) {
  const int i = e.find_property(names);
  return i >= 0 && e.properties[static_cast<std::size_t>(i)].is_list ? i : -1;
}

/// The columns, or none where one is missing: then nothing of them is read.
template <std::size_t N>
std::array<int, N> all_or_none(std::array<int, N> columns) {
  if (std::ranges::any_of(columns, [](int c) { return c < 0; })) columns.fill(-1);
  return columns;
}

/// Artec's elements, until the faces are known to which they belong.
struct ArtecTexturing {
  struct Face {
    std::size_t begin = 0;  // of its corners in `corners`
    std::int32_t texture = 0;
  };
  std::vector<Vec2f> uv;  // of all textures
  std::vector<Face> faces;
  std::vector<std::uint32_t> corners;  // indices into uv
};

/// Reads the elements vertex, face, tristrips and those of Artec. InputError for a file without faces
/// and for more than the options allow.
class SurfaceReader {
 public:
  SurfaceReader(const std::string& file, std::span<const std::uint8_t> bytes, const ImportOptions& options,
                const RunContext& context)
      : file_(file),
        header_(read_ply_header(file, bytes)),
        rows_(file, bytes, header_),
        options_(options),
        context_(context) {}

  PlySurface read() {
    read_elements();
    if (surface_.vertices.positions.empty())
      throw InputError(file_, "header", "an element vertex with x, y and z", "none");
    if (surface_.faces.count() == 0)
      throw InputError(file_, "", "faces",
                       std::string(is_splats_ ? "none (Gaussian splats: " : "none (a point cloud of ") +
                           std::to_string(surface_.vertices.positions.size()) + " points)");
    check_face_count();
    surface_.end = rows_.end();
    surface_.comments = std::move(header_.comments);
    return std::move(surface_);
  }

 private:
  void read_elements() {
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      rows_.begin(element);
      if (element.name == "vertex")
        read_vertices(element);
      else if (element.name == "face")
        read_faces(element);
      else if (element.name == "tristrips")
        read_strips(element);
      else if (element.name == "multi_texture_vertex")
        read_artec_vertices(element);
      else if (element.name == "multi_texture_face")
        read_artec_faces(element);
      else
        skip(element);
    }
    place_artec_uvs();
  }

  void read_artec_vertices(const PlyElement& element) {
    check_count(element, options_.max_vertices);
    const int u = find_scalar(element, {"u", "s"}), v = find_scalar(element, {"v", "t"});
    if (u < 0 || v < 0) return skip(element);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      check_cancelled(i);
      rows_.next(row_);
      artec_.uv.push_back(
          flipped(row_.values[static_cast<std::size_t>(u)], row_.values[static_cast<std::size_t>(v)]));
    }
  }

  void read_artec_faces(const PlyElement& element) {
    check_count(element, options_.max_triangles);
    const int texture = find_scalar(element, {"tx"}),
              corners = find_list(element, {"texture_vertex_indices"});
    if (corners < 0) return skip(element);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      check_cancelled(i);
      rows_.next(row_);
      const std::int32_t number =
          texture < 0 ? 0 : texture_number(row_.values[static_cast<std::size_t>(texture)]);
      artec_.faces.push_back({artec_.corners.size(), number});
      for (const double index : row_.lists[static_cast<std::size_t>(corners)])
        artec_.corners.push_back(index_of(index));
      surface_.artec_textures = std::max(surface_.artec_textures, number + 1);
    }
  }

  void place_artec_uvs() {
    PlyFaces& faces = surface_.faces;
    if (artec_.uv.empty() || artec_.faces.empty()) return;
    faces.uv.resize(faces.index.size());
    faces.has_uv.resize(faces.count());
    faces.texture.resize(faces.count(), -1);
    for (std::size_t i = 0; i < artec_.faces.size(); ++i) {
      const ArtecTexturing::Face& of = artec_.faces[i];
      const std::size_t end = i + 1 < artec_.faces.size() ? artec_.faces[i + 1].begin : artec_.corners.size();
      const std::span<const std::uint32_t> corners(artec_.corners.data() + of.begin, end - of.begin);
      const auto is_there = [&](std::uint32_t c) { return c < artec_.uv.size(); };
      if (i >= faces.count() || corners.size() != faces.begin[i + 1] - faces.begin[i] ||
          !std::all_of(corners.begin(), corners.end(), is_there)) {
        ++surface_.odd_texcoords;
        continue;
      }
      for (std::size_t k = 0; k < corners.size(); ++k) faces.uv[faces.begin[i] + k] = artec_.uv[corners[k]];
      faces.has_uv[i] = 1;
      faces.texture[i] = of.texture;
    }
  }

  /// What is read of an element has these columns.
  void count_unread(const PlyElement& element, std::initializer_list<int> columns,
                    const ColourColumns* colours) {
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const auto is_column = [p](int c) { return c == static_cast<int>(p); };
      const bool is_read =
          std::any_of(columns.begin(), columns.end(), is_column) ||
          (colours && std::any_of(colours->column.begin(), colours->column.end(), is_column));
      if (!is_read)
        count_lost(surface_.lost, "values " + quote(element.properties[p].name) + " of " + element.name,
                   element.count);
    }
  }

  void check_cancelled(std::uint64_t row) const {
    if (row % 65536 == 0) context_.check_cancelled();
  }

  void skip(const PlyElement& element) {
    count_lost(surface_.lost, "elements " + quote(element.name), element.count);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      check_cancelled(i);
      rows_.next(row_);
    }
  }

  void note_extra() {
    if (!row_.extra.empty() && surface_.long_lines++ == 0) surface_.first_long_line = rows_.place();
  }

  void check_count(const PlyElement& element, int limit) const {
    if (element.count > static_cast<std::uint64_t>(limit))
      throw InputError(file_, "element " + element.name, "at most " + std::to_string(limit),
                       std::to_string(element.count));
  }

  void read_vertices(const PlyElement& element) {
    check_count(element, options_.max_vertices);
    const std::array<int, 3> xyz{find_scalar(element, {"x"}), find_scalar(element, {"y"}),
                                 find_scalar(element, {"z"})};
    if (xyz[0] < 0 || xyz[1] < 0 || xyz[2] < 0)
      throw InputError(file_, "element vertex", "properties x, y and z", "not all of them");
    const auto n = all_or_none<3>(
        {find_scalar(element, {"nx"}), find_scalar(element, {"ny"}), find_scalar(element, {"nz"})});
    const auto st =
        all_or_none<2>({find_scalar(element, {"s", "u", "texture_u", "texture_s", "texcoord_u", "tu"}),
                        find_scalar(element, {"t", "v", "texture_v", "texture_t", "texcoord_v", "tv"})});
    is_splats_ = element.find_property({"f_dc_0"}) >= 0 && element.find_property({"scale_0"}) >= 0;
    const ColourColumns colours(element);
    const bool has_normals = n[0] >= 0, has_uv = st[0] >= 0;
    count_unread(element, {xyz[0], xyz[1], xyz[2], n[0], n[1], n[2], st[0], st[1]}, &colours);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      check_cancelled(i);
      rows_.next(row_);
      note_extra();
      auto value = [this](int column) { return row_.values[static_cast<std::size_t>(column)]; };
      surface_.vertices.positions.push_back({value(xyz[0]), value(xyz[1]), value(xyz[2])});
      if (has_normals)
        surface_.vertices.normals.push_back(to_float(Vec3d{value(n[0]), value(n[1]), value(n[2])}));
      if (has_uv) surface_.vertices.uv.push_back(flipped(value(st[0]), value(st[1])));
      if (colours.any()) surface_.vertices.colours.push_back(colours.read(row_));
    }
    if (colours.is_float()) ColourColumns::to_linear(surface_.vertices.colours);
  }

  static Vec2f flipped(double u, double v) { return {static_cast<float>(u), static_cast<float>(1 - v)}; }

  /// kNoIndex for what can be no index.
  static std::uint32_t index_of(double value) {
    const bool good = value >= 0 && value <= 4294967294.0 && value == std::floor(value);
    return good ? static_cast<std::uint32_t>(value) : kNoIndex;
  }

  void add_index(double value) { surface_.faces.index.push_back(index_of(value)); }

  void read_faces(const PlyElement& element) {
    const int corners = find_list(element, {"vertex_indices", "vertex_index"});
    if (corners < 0) throw InputError(file_, "element face", "a list vertex_indices", "none");
    const int texcoord = find_list(element, {"texcoord"}), texnumber = find_scalar(element, {"texnumber"});
    const ColourColumns colours(element);
    const std::size_t before = surface_.faces.index.size();
    count_unread(element, {corners, texcoord, texnumber}, &colours);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      check_cancelled(i);
      rows_.next(row_);
      note_extra();
      const auto& indices = row_.lists[static_cast<std::size_t>(corners)];
      for (double index : indices) add_index(index);
      if (texcoord >= 0) add_face_uvs(row_.lists[static_cast<std::size_t>(texcoord)], indices.size());
      add_face_colours(colours, indices.size());
      if (texnumber >= 0)
        surface_.faces.texture.push_back(texture_number(row_.values[static_cast<std::size_t>(texnumber)]));
      surface_.faces.begin.push_back(surface_.faces.index.size());
    }
    if (colours.is_float() && surface_.faces.colours.size() > before)
      ColourColumns::to_linear(std::span(surface_.faces.colours).subspan(before));
  }

  static std::int32_t texture_number(double value) {
    return value >= 0 && value < 65536 && value == std::floor(value) ? static_cast<std::int32_t>(value) : -1;
  }

  void add_face_uvs(const std::vector<double>& uvs, std::size_t corners) {
    const bool good = uvs.size() == 2 * corners;
    if (!good && !uvs.empty()) ++surface_.odd_texcoords;
    surface_.faces.uv.resize(surface_.faces.begin.back());  // faces before this element's have none
    for (std::size_t k = 0; k < corners; ++k)
      surface_.faces.uv.push_back(good ? flipped(uvs[2 * k], uvs[2 * k + 1]) : Vec2f{});
    surface_.faces.has_uv.push_back(good);
  }

  // VCG's exporter has a bug: where it writes a colour per corner it declares a colour per face. Such a
  // line ends in `9 r g b r g b r g b`, so the declared columns hold the wrong numbers and the tail
  // holds the colours.
  bool add_vcg_corner_colours(const ColourColumns& columns, std::size_t corners) {
    const std::size_t declared = row_.values.size() - static_cast<std::size_t>(columns.column[0]);
    if (row_.extra.empty()) return false;
    std::vector<double> tail(row_.values.end() - static_cast<std::ptrdiff_t>(declared), row_.values.end());
    tail.insert(tail.end(), row_.extra.begin(), row_.extra.end());
    const double n = 3.0 * static_cast<double>(corners);
    if (tail.front() != n || static_cast<double>(tail.size()) != n + 1) return false;
    const auto value = [&](std::size_t i) {
      return columns.is_float() ? static_cast<float>(tail[i]) : linear_from_srgb(tail[i]);
    };
    for (std::size_t k = 0; k < corners; ++k)
      surface_.faces.colours.push_back({value(3 * k + 1), value(3 * k + 2), value(3 * k + 3), 1});
    return true;
  }

  void add_face_colours(const ColourColumns& columns, std::size_t corners) {
    if (!columns.any()) return;
    surface_.faces.colours.resize(surface_.faces.begin.back(), {1, 1, 1, 1});
    if (add_vcg_corner_colours(columns, corners)) return;
    // Numbers too many of any other kind: which of them is the colour cannot be told.
    const Vec4f colour = row_.extra.empty() ? columns.read(row_) : Vec4f{1, 1, 1, 1};
    surface_.faces.colours.insert(surface_.faces.colours.end(), corners, colour);
  }

  void read_strips(const PlyElement& element) {
    const int corners = find_list(element, {"vertex_indices", "vertex_index"});
    if (corners < 0) throw InputError(file_, "element tristrips", "a list vertex_indices", "none");
    for (std::uint64_t i = 0; i < element.count; ++i) {
      rows_.next(row_);
      std::size_t start = 0;
      const auto& strip = row_.lists[static_cast<std::size_t>(corners)];
      for (std::size_t k = 0; k < strip.size(); ++k) {
        check_cancelled(k);
        if (strip[k] < 0) {
          start = k + 1;
        } else if (k >= start + 2) {
          const bool odd = (k - start) % 2 != 0;
          for (std::size_t c : {k - 2, odd ? k : k - 1, odd ? k - 1 : k}) add_index(strip[c]);
          surface_.faces.begin.push_back(surface_.faces.index.size());
        }
      }
    }
  }

  void check_face_count() const {
    if (surface_.faces.count() > static_cast<std::size_t>(options_.max_triangles))
      throw InputError(file_, "element face", "at most " + std::to_string(options_.max_triangles),
                       std::to_string(surface_.faces.count()));
  }

  const std::string& file_;
  PlyHeader header_;
  PlyRows rows_;
  const ImportOptions& options_;
  const RunContext& context_;
  PlyRow row_;
  PlySurface surface_;
  ArtecTexturing artec_;
  bool is_splats_ = false;
};

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

  Model build(Lost& lost) {
    add_materials();
    check_texture_numbers();
    build_mesh();
    tiled_.split(model_, resolver_, file_, options_);
    add_notes(lost);
    finish_scan(model_, file_, options_, context_);
    return std::move(model_);
  }

 private:
  bool has_uv() const { return !surface_.vertices.uv.empty() || !surface_.faces.uv.empty(); }
  bool has_colours() const { return !surface_.vertices.colours.empty() || !surface_.faces.colours.empty(); }

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
            tiled_.add_image(model_, {name, "", false}, resolver_, file_, "comment TextureFile", options_);
      model_.materials.push_back(std::move(material));
    }
    if (model_.materials.size() == 1) add_artec_materials(plain);
    if (model_.materials.size() == 1 && has_uv() && !has_colours()) add_material_of_stem(plain);
    if (model_.materials.size() > 1 && !has_uv())
      add_warning(
          model_.notes, "texture-without-uv", "header",
          "a TextureFile is named but there are no texture coordinates (s t, u v or texture_u texture_v of "
          "vertices, texcoord of faces)");
  }

  void add_material_of_stem(Material material) {
    material.name = file_.substr(0, file_.rfind('.'));
    material.base_colour_texture.image = add_unnamed_texture(model_, resolver_, file_, "header", options_);
    if (material.base_colour_texture.used()) model_.materials.push_back(std::move(material));
  }

  /// Artec Studio names the pictures after the model. A model that was renamed has often got a longer name:
  /// "plate-small.ply" takes plate_0.jpg where there is no plate-small_0.jpg.
  void add_artec_materials(const Material& plain) {
    const std::string stem = file_.substr(0, file_.find_last_of('.'));
    for (std::int32_t t = 0; t < surface_.artec_textures && t < 65534; ++t) {
      Material material = plain;
      material.name = stem + "_" + std::to_string(t);
      std::string looked_for;
      for (std::size_t end = stem.size();
           end != 0 && end != stem.npos && !material.base_colour_texture.used();
           end = stem.find_last_of("-_ .", end - 1))
        material.base_colour_texture.image =
            artec_image(stem.substr(0, end) + "_" + std::to_string(t), looked_for);
      if (!material.base_colour_texture.used())
        add_warning(model_.notes, "missing-texture", kArtecPlace,
                    "texture " + std::to_string(t) + " not found: looked for " + looked_for +
                        "; the material stays without it");
      model_.materials.push_back(std::move(material));
    }
  }

  std::int32_t artec_image(const std::string& name, std::string& looked_for) {
    const std::int32_t image = add_image_of_stem(model_, name, resolver_, file_, kArtecPlace, options_);
    if (image >= 0)
      add_info(model_.notes, "texture-by-name", kArtecPlace,
               "no comment names the textures; " +
                   quote(model_.images[static_cast<std::size_t>(image)].name) + " is taken by its name");
    else
      looked_for += (looked_for.empty() ? "" : ", ") + quote(name + ".jpg") + " or with another ending";
    return image;
  }
  static constexpr const char* kArtecPlace = "element multi_texture_face";

  std::uint16_t material_of(std::size_t face) const {
    if (face < surface_.faces.has_uv.size() && !surface_.faces.has_uv[face] && surface_.vertices.uv.empty())
      return 0;
    const std::int32_t texture = face < surface_.faces.texture.size() ? surface_.faces.texture[face] : 0;
    return texture < 0 || is_beyond(texture) ? 0 : static_cast<std::uint16_t>(texture + 1);
  }

  /// Some count from 1.
  void check_texture_numbers() {
    std::vector<std::int32_t>& numbers = surface_.faces.texture;
    const auto beyond = std::ranges::count_if(numbers, [this](std::int32_t t) { return is_beyond(t); });
    const std::size_t textures = model_.materials.size() - 1;
    if (numbers.empty() && textures > 1 && has_uv())
      add_warning(model_.notes, "odd-texture-number", "element face",
                  "without a texnumber the first of the " + std::to_string(textures) + " textures is taken");
    if (beyond == 0 || textures == 0) return;
    const std::set<std::int32_t> all(numbers.begin(), numbers.end());
    const bool is_only = textures == 1 && all.size() == 1;
    if (is_only) std::ranges::fill(numbers, 0);
    add_warning(model_.notes, "odd-texture-number", "element face",
                "texture numbers of " + std::to_string(beyond) + " faces are beyond the last of the " +
                    std::to_string(textures) + " textures, which count from 0; " +
                    (is_only ? "the only texture is taken" : "these faces stay untextured"));
  }

  /// No comment names the texture of this number.
  bool is_beyond(std::int32_t texture) const {
    return texture + 1 >= static_cast<std::int32_t>(model_.materials.size());
  }

  bool textured(std::uint16_t material) const {
    return model_.materials[material].base_colour_texture.used();
  }

  void build_mesh() {
    bool all_textured = true;
    for (std::size_t f = 0; f < surface_.faces.count() && all_textured; ++f)
      all_textured = textured(material_of(f));
    const bool any_colours = has_colours();
    if (any_colours && all_textured)
      add_info(model_.notes, "colours-beside-texture", "",
               "vertex or face colours are left out where a texture shows");
    MeshBuilder builder(surface_.vertices.positions,
                        {has_uv(), !surface_.vertices.normals.empty(), any_colours && !all_textured});
    std::vector<Corner> corners;
    for (std::size_t f = 0; f < surface_.faces.count(); ++f) {
      if (f % 65536 == 0) context_.check_cancelled();
      const std::uint16_t material = material_of(f);
      if (!has_all_vertices(f)) {
        if (broken_faces_++ == 0) first_broken_face_ = f;
        continue;
      }
      corners.clear();
      for (std::size_t k = surface_.faces.begin[f]; k < surface_.faces.begin[f + 1]; ++k)
        corners.push_back(corner(f, k, textured(material)));
      builder.add_face(corners, material, 0);
      if (corners.size() < 3) ++small_faces_;
    }
    if (broken_faces_ == surface_.faces.count())
      throw InputError(file_, "element face",
                       "a face of the " + std::to_string(surface_.vertices.positions.size()) + " vertices",
                       "none");
    model_.mesh = builder.finish();
  }

  bool has_all_vertices(std::size_t face) const {
    const PlyFaces& faces = surface_.faces;
    for (std::size_t k = faces.begin[face]; k < faces.begin[face + 1]; ++k)
      if (faces.index[k] >= surface_.vertices.positions.size()) return false;
    return true;
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

  void add_notes(Lost& lost) {
    if (surface_.long_lines)
      add_warning(model_.notes, "over-long-lines", surface_.first_long_line,
                  std::to_string(surface_.long_lines) +
                      " lines have more numbers than the header declares; what it declares is read");
    if (surface_.odd_texcoords)
      add_warning(model_.notes, "odd-texcoord-list", "element face",
                  std::to_string(surface_.odd_texcoords) +
                      " faces whose texcoord list does not hold two numbers per corner");
    if (broken_faces_) {
      lost["faces with missing vertices"] = broken_faces_;
      add_warning(model_.notes, "broken-face", "element face",
                  std::to_string(broken_faces_) +
                      " faces name a vertex that is not there and are left out; face " +
                      std::to_string(first_broken_face_) + " is the first one");
    }
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
  TiledImages tiled_;
  std::uint64_t small_faces_ = 0, broken_faces_ = 0;
  std::size_t first_broken_face_ = 0;
};

}  // namespace

ImportedModel import_ply(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  ImportedModel out;
  PlySurface surface = SurfaceReader(file_name, bytes, options, context).read();
  const std::size_t end = surface.end;
  out.format = "ply";
  Notes notes;
  out.lost = std::move(surface.lost);
  for (std::string& comment : surface.comments) comment = source_text(comment, file_name, notes);
  out.about = about_from_comments(surface.comments, out.format, notes);
  out.model = PlyModel(file_name, std::move(surface), resolver, options, context).build(out.lost);
  tell_trailing_bytes(notes, bytes, end);
  out.model.notes.insert(out.model.notes.end(), notes.begin(), notes.end());
  return out;
}

}  // namespace texmesh
