#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/text_scan.h"

// STL knows triangles only: no colour, no texture, no shared vertices. Its face normals repeat the winding
// (and are often 0), so they are ignored; the "attribute byte count" has no agreed meaning (VisCAM and Magics
// put different colours there) and is ignored too. Equal points become one position, bit by bit (0 and -0
// count as equal), so that neighbours share edges.

namespace texmesh {
namespace {

constexpr std::size_t kStlHeaderBytes = 84, kTriangleBytes = 50;

std::uint32_t binary_count(ByteSpan bytes) { return value_at<std::uint32_t>(bytes.data() + 80); }

// Many binary files begin with "solid", so the size decides first; text decides where the size is wrong.
bool is_binary(std::span<const std::uint8_t> bytes) {
  if (bytes.size() >= kStlHeaderBytes &&
      bytes.size() == kStlHeaderBytes + std::uint64_t{kTriangleBytes} * binary_count(bytes))
    return true;
  const std::string_view text = trim(text_of(bytes).substr(0, 1024));
  if (!same_word(text.substr(0, 5), "solid")) return true;
  return text.find('\0') != std::string_view::npos;
}

std::vector<Vec3f> read_binary(const std::string& file, std::span<const std::uint8_t> bytes,
                               const ImportOptions& options) {
  if (bytes.size() < kStlHeaderBytes)
    throw InputError(file, "header",
                     std::to_string(kStlHeaderBytes) + " bytes, or text that begins with \"solid\"",
                     std::to_string(bytes.size()) + " bytes");
  const std::uint32_t count = binary_count(bytes);
  const std::uint64_t needed = kStlHeaderBytes + std::uint64_t{kTriangleBytes} * count;
  if (bytes.size() < needed)
    throw InputError(file, "byte 80 (triangle count)",
                     std::to_string(needed) + " bytes for " + std::to_string(count) + " triangles",
                     std::to_string(bytes.size()) + " bytes");
  if (count > static_cast<std::uint64_t>(options.max_triangles))
    throw InputError(file, "byte 80 (triangle count)", "at most " + std::to_string(options.max_triangles),
                     std::to_string(count));
  std::vector<Vec3f> points(std::size_t{3} * count);
  for (std::size_t t = 0; t < count; ++t)
    std::memcpy(&points[3 * t], bytes.data() + kStlHeaderBytes + t * kTriangleBytes + 12, 36);
  return points;
}

/// Triangles whose attribute bytes are not 0.
std::uint64_t with_attributes(std::span<const std::uint8_t> bytes, std::size_t triangles) {
  std::uint64_t count = 0;
  for (std::size_t t = 1; t <= triangles; ++t) {
    const std::uint8_t* end = bytes.data() + kStlHeaderBytes + t * kTriangleBytes;
    count += end[-1] != 0 || end[-2] != 0;
  }
  return count;
}

std::vector<Vec3f> read_ascii(const std::string& file, std::span<const std::uint8_t> bytes) {
  LineReader lines(text_of(bytes));
  std::string_view line;
  std::vector<Vec3f> points;
  std::size_t in_facet = 0;
  bool ended = false;
  while (lines.next(line)) {
    const std::string_view word = next_token(line);
    if (same_word(word, "vertex")) {
      double x[3];
      for (double& value : x) {
        const std::string_view token = next_token(line);
        if (!parse_number(token, value))
          throw InputError(file, lines.place(), "vertex and three numbers", quote(token));
      }
      if (++in_facet > 3) throw InputError(file, lines.place(), "three vertices in a facet", "a fourth");
      points.push_back(to_float(Vec3d{x[0], x[1], x[2]}));
    } else if (same_word(word, "endfacet")) {
      if (in_facet != 3)
        throw InputError(file, lines.place(), "three vertices in a facet", std::to_string(in_facet));
      in_facet = 0;
    } else if (same_word(word, "endsolid")) {
      ended = true;
    } else if (!word.empty() && !same_word(word, "solid") && !same_word(word, "facet") &&
               !same_word(word, "outer") && !same_word(word, "endloop")) {
      throw InputError(file, lines.place(), "a statement of STL", quote(word));
    }
  }
  if (in_facet != 0 || !ended) throw InputError(file, lines.place(), "endsolid", "the end of the file");
  return points;
}

std::uint32_t bits_of(float x) { return x == 0 ? 0 : std::bit_cast<std::uint32_t>(x); }

std::uint64_t hash_of(const Vec3f& p) {
  std::uint64_t hash = 0;
  for (const float x : {p.x, p.y, p.z}) hash = hash_with(hash, bits_of(x));
  return hash;
}

bool same_point(const Vec3f& a, const Vec3f& b) {
  return bits_of(a.x) == bits_of(b.x) && bits_of(a.y) == bits_of(b.y) && bits_of(a.z) == bits_of(b.z);
}

// Indices into `unique`, which is filled in order of first use.
std::vector<std::uint32_t> weld(const std::vector<Vec3f>& points, std::vector<Vec3d>& unique) {
  std::vector<std::uint32_t> index, first;  // first: of a unique point, the place in `points`
  index.reserve(points.size());
  FirstUseTable table(points.size() / 4);  // six triangles share a point of a closed surface
  for (std::size_t i = 0; i < points.size(); ++i) {
    index.push_back(table.number_of(
        hash_of(points[i]), [&](std::uint32_t n) { return same_point(points[first[n]], points[i]); },
        [&](std::uint32_t n) { return hash_of(points[first[n]]); }));
    if (index.back() < first.size()) continue;
    first.push_back(static_cast<std::uint32_t>(i));
    unique.push_back(to_double(points[i]));
  }
  return index;
}

}  // namespace

ImportedModel import_stl(const std::string& file_name, std::span<const std::uint8_t> bytes,
                         const ImportOptions& options, const RunContext& context) {
  const std::vector<Vec3f> points =
      is_binary(bytes) ? read_binary(file_name, bytes, options) : read_ascii(file_name, bytes);
  context.check_cancelled();
  ImportedModel out;
  out.format = "stl";
  if (const std::uint64_t coloured = is_binary(bytes) ? with_attributes(bytes, points.size() / 3) : 0)
    out.lost["colours or other attributes of triangles"] = coloured;
  Mesh& mesh = out.model.mesh;
  std::vector<Vec3d> unique;
  const std::vector<std::uint32_t> index = weld(points, unique);
  set_positions(mesh, unique);
  for (std::uint32_t p = 0; p < unique.size(); ++p) mesh.wedge_position.push_back(p);
  for (std::size_t i = 0; i + 2 < index.size(); i += 3)
    mesh.triangles.push_back({index[i], index[i + 1], index[i + 2]});
  out.model.materials.push_back(scan_material("untextured"));
  finish_scan(out.model, file_name, options, context);
  if (is_binary(bytes))
    tell_trailing_bytes(out.model.notes, bytes, kStlHeaderBytes + kTriangleBytes * points.size() / 3);
  return out;
}

}  // namespace texmesh
