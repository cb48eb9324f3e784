#include "pipeline/import/obj/obj_reader.h"

#include <algorithm>
#include <limits>
#include <map>

#include "format/base/errors.h"
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

constexpr std::int64_t kMaxIndex = 2'000'000'000;
constexpr std::size_t kMaxNames = 65535;  // parts, materials

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
      : file_(file), lines_(without_bom(text)), options_(options), context_(context) {}

  ObjData read() {
    material_ = material_numbers_.number_of("", data_.materials, materials_full_);
    part_ = part_numbers_.number_of("", data_.parts, data_.parts_full);
    std::string_view line;
    while (lines_.next(line)) {
      if (lines_.number() % 65536 == 0) context_.check_cancelled();
      if (!line.empty() && line.back() == '\\') line = continued(line);
      statement(line);
    }
    check_references();
    return std::move(data_);
  }

 private:
  static std::string_view without_bom(std::string_view text) {
    return text.substr(0, 3) == "\xef\xbb\xbf" ? text.substr(3) : text;
  }

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
    if (word.empty() || word[0] == '#') return;
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

  // 1 is the first, -1 the latest; 0 is none. Indices may run ahead of their vertices: check_references() has
  // the last word.
  std::uint32_t index(std::string_view token, std::size_t count) const {
    std::int64_t i = 0;
    if (!parse_integer(token, i)) fail("a face corner such as 3, 3/1 or 3/1/2", quote(token));
    if (i < 0) i += static_cast<std::int64_t>(count) + 1;
    if (i < 1 || i > kMaxIndex)
      fail("an index from 1 or from -" + std::to_string(count) + " to -1", quote(token));
    return static_cast<std::uint32_t>(i - 1);
  }

  ObjCorner corner(std::string_view token) const {
    ObjCorner r;
    const std::size_t slash = token.find('/');
    r.position = index(token.substr(0, slash), data_.positions.size());
    if (slash == std::string_view::npos) return r;
    token.remove_prefix(slash + 1);
    const std::size_t second = token.find('/');
    if (second != 0 && !token.empty()) r.uv = index(token.substr(0, second), data_.uvs.size());
    if (second == std::string_view::npos) return r;
    token.remove_prefix(second + 1);
    if (!token.empty()) r.normal = index(token, data_.normals.size());
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

  void check_references() const {
    auto check = [this](std::uint32_t i, std::size_t count, const char* what, std::size_t f) {
      if (i != kNoIndex && i >= count)
        throw InputError(file_, "line " + std::to_string(data_.faces[f].line),
                         std::string(what) + " index up to " + std::to_string(count),
                         std::to_string(std::uint64_t{i} + 1));
    };
    for (std::size_t f = 0; f < data_.faces.size(); ++f)
      for (const ObjCorner& r : data_.corners_of(f)) {
        check(r.position, data_.positions.size(), "a vertex", f);
        check(r.uv, data_.uvs.size(), "a texture coordinate", f);
        check(r.normal, data_.normals.size(), "a normal", f);
      }
  }

  const std::string& file_;
  LineReader lines_;
  const ImportOptions& options_;
  const RunContext& context_;
  ObjData data_;
  NameTable material_numbers_, part_numbers_;
  std::string object_, group_, joined_;
  std::uint16_t material_ = 0, part_ = 0;
  bool materials_full_ = false;
};

}  // namespace

ObjData read_obj(const std::string& file, std::string_view text, const ImportOptions& options,
                 const RunContext& context) {
  return ObjReader(file, text, options, context).read();
}

}  // namespace texmesh
