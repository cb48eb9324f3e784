#include "stages/gltf/scale_codecs.h"

#include <meshoptimizer.h>

#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;

/// Vertices in the order of first use by cache-friendly triangles: both codecs, and deflate, profit.
void order_for_codec(ScalePrimitive& primitive) {
  std::vector<std::uint32_t> indices(primitive.indices.size()), remap(primitive.wedges.size());
  meshopt_optimizeVertexCache(indices.data(), primitive.indices.data(), indices.size(),
                              primitive.wedges.size());
  meshopt_optimizeVertexFetchRemap(remap.data(), indices.data(), indices.size(), primitive.wedges.size());
  std::vector<std::uint32_t> wedges(primitive.wedges.size());
  std::vector<std::uint16_t> parts(primitive.wedge_part.size());
  for (std::size_t i = 0; i < remap.size(); ++i) wedges[remap[i]] = primitive.wedges[i];
  for (std::size_t i = 0; i < parts.size(); ++i) parts[remap[i]] = primitive.wedge_part[i];
  primitive.wedge_part = std::move(parts);
  for (std::uint32_t& i : indices) i = remap[i];
  primitive.indices = std::move(indices);
  primitive.wedges = std::move(wedges);
}

/// Bytes of one vertex or index stream, elements padded to `stride`.
struct Stream {
  std::vector<std::uint8_t> bytes;
  std::size_t stride = 0, count = 0;
};

/// `value(i)` gives an element as an array of numbers. Elements are padded to a multiple of `align`.
Stream make_stream(std::size_t count, const auto& value, std::size_t align = 4) {
  using Element = std::remove_cvref_t<decltype(value(std::size_t{0}))>;
  Stream s{{}, (sizeof(Element) + align - 1) / align * align, count};
  s.bytes.resize(count * s.stride);
  for (std::size_t i = 0; i < count; ++i) {
    const Element element = value(i);
    std::memcpy(s.bytes.data() + i * s.stride, element.data(), sizeof element);
  }
  return s;
}

/// Numbers from -1 or, without a sign, 0 to 1 as normalised integers; floats as they are.
template <class T, std::size_t N>
std::array<T, N> coded(const std::array<float, N>& values) {
  if constexpr (std::is_same_v<T, float>) {
    return values;
  } else {
    constexpr float kOne = std::numeric_limits<T>::max(), kLeast = std::is_signed_v<T> ? -1 : 0;
    std::array<T, N> out;
    for (std::size_t k = 0; k < N; ++k)
      out[k] = static_cast<T>(std::floor(std::clamp(values[k], kLeast, 1.0f) * kOne + 0.5f));
    return out;
  }
}

std::array<float, 3> numbers_of(Vec3f v) { return {v.x, v.y, v.z}; }
std::array<float, 4> numbers_of(Vec4f v) { return {v.x, v.y, v.z, v.w}; }

class PlainPrimitive {
 public:
  PlainPrimitive(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive)
      : writer_(writer), coding_(coding), primitive_(primitive), n_(primitive.wedges.size()) {}

  CodedPrimitive code() {
    CodedPrimitive coded;
    coded.triangles = static_cast<std::uint32_t>(primitive_.indices.size() / 3);
    coded.vertices = static_cast<std::uint32_t>(n_);
    GltfJson& attributes = coded.json["attributes"];
    attributes["POSITION"] = positions();
    if (!coding_.mesh.normals.empty()) attributes["NORMAL"] = normals();
    for (int set = 0; set < 2; ++set)
      if (coding_.write_uv[set]) attributes["TEXCOORD_" + std::to_string(set)] = uvs(set);
    if (!coding_.mesh.colours.empty()) attributes["COLOR_0"] = colours();
    if (coding_.writes_tangents(primitive_)) attributes["TANGENT"] = tangents();
    if (!primitive_.wedge_part.empty()) attributes["_FEATURE_ID_0"] = parts();
    coded.json["indices"] = indices();
    return coded;
  }

 private:
  bool compact() const { return coding_.options.mesh_codec != MeshCodec::kNone; }

  std::size_t add(const Stream& s, bool is_index) {
    const int target = is_index ? kElementArrayBuffer : kArrayBuffer;
    if (coding_.options.mesh_codec != MeshCodec::kMeshopt)
      return writer_.add_view(s.bytes, is_index ? 0 : s.stride, target);
    const std::vector<std::uint8_t> packed = is_index
                                                 ? meshopt_triangles(primitive_.indices, n_, "scales")
                                                 : meshopt_attributes(s.bytes, s.count, s.stride, "scales");
    return writer_.add_meshopt_view(packed, s.count, s.stride, is_index, target);
  }

  std::size_t positions() {
    const Mesh& m = coding_.mesh;
    const bool on_grid = coding_.positions_are_indices();
    Box3f box;
    auto position = [&](std::size_t i) {
      const Vec3f p = m.positions[m.wedge_position[primitive_.wedges[i]]];
      const Vec3f q = on_grid ? coding_.position.place(p) : p;
      box.extend(q);
      return q;
    };
    const auto as = [&]<class T>(T) {
      return make_stream(n_, [&](std::size_t i) {
        const Vec3f q = position(i);
        return std::array<T, 3>{static_cast<T>(q.x), static_cast<T>(q.y), static_cast<T>(q.z)};
      });
    };
    const Stream s = on_grid ? as(std::uint16_t{}) : as(float{});
    if (on_grid) writer_.use_extension("KHR_mesh_quantization", true);
    GltfJson accessor{{"bufferView", add(s, false)},
                      {"componentType", on_grid ? 5123 : 5126},
                      {"count", n_},
                      {"type", "VEC3"}};
    if (on_grid) {
      accessor["min"] = {static_cast<int>(box.min.x), static_cast<int>(box.min.y),
                         static_cast<int>(box.min.z)};
      accessor["max"] = {static_cast<int>(box.max.x), static_cast<int>(box.max.y),
                         static_cast<int>(box.max.z)};
    } else {
      accessor["min"] = {box.min.x, box.min.y, box.min.z};
      accessor["max"] = {box.max.x, box.max.y, box.max.z};
    }
    return writer_.add_accessor(std::move(accessor));
  }

  /// An attribute of T, `of_wedge(w)` as numbers.
  template <class T>
  std::size_t attribute(const auto& of_wedge) {
    using Numbers = std::remove_cvref_t<decltype(of_wedge(0u))>;
    constexpr bool kIsFloat = std::is_same_v<T, float>;
    constexpr int kType = kIsFloat ? 5126 : 5119 + 2 * static_cast<int>(sizeof(T)) - std::is_signed_v<T>;
    const Stream s = make_stream(n_, [&](std::size_t i) { return coded<T>(of_wedge(primitive_.wedges[i])); });
    GltfJson accessor{{"bufferView", add(s, false)}, {"componentType", kType}};
    if (!kIsFloat) accessor["normalized"] = true;
    accessor["count"] = n_;
    accessor["type"] = "VEC" + std::to_string(std::tuple_size_v<Numbers>);
    return writer_.add_accessor(std::move(accessor));
  }
  std::size_t signed_attribute(int bits, const auto& of_wedge) {
    if (!compact()) return attribute<float>(of_wedge);
    return bits > 8 ? attribute<std::int16_t>(of_wedge) : attribute<std::int8_t>(of_wedge);
  }

  std::size_t normals() {
    if (compact()) writer_.use_extension("KHR_mesh_quantization", true);
    return signed_attribute(coding_.options.normal_bits,
                            [&](std::uint32_t w) { return numbers_of(coding_.frames.normals[w]); });
  }

  std::size_t parts() {
    const Stream s = make_stream(n_, [&](std::size_t i) { return std::array{primitive_.wedge_part[i]}; });
    return writer_.add_accessor(
        {{"bufferView", add(s, false)}, {"componentType", 5123}, {"count", n_}, {"type", "SCALAR"}});
  }

  std::size_t tangents() {
    return signed_attribute(coding_.options.tangent_bits,
                            [&](std::uint32_t w) { return numbers_of(coding_.frames.tangents[w]); });
  }

  /// 16 normalised bits where all coordinates lie in 0..1 and the step is fine enough; floats elsewhere,
  /// because another range would need a texture transform that may clash with the material's own.
  std::size_t uvs(int set) {
    const QuantisationGrid& grid = coding_.uv[set];
    const bool unit = compact() && grid.bits > 0 && grid.origin == Vec3f{} && grid.range == 1;
    const auto of_wedge = [&](std::uint32_t w) {
      const Vec2f p = coding_.uv_values(set)[w];
      return std::array<float, 2>{p.x, p.y};
    };
    return unit ? attribute<std::uint16_t>(of_wedge) : attribute<float>(of_wedge);
  }

  std::size_t colours() {
    const auto of_wedge = [&](std::uint32_t w) { return numbers_of(coding_.mesh.colours[w]); };
    return coding_.fine_colours ? attribute<std::uint16_t>(of_wedge) : attribute<std::uint8_t>(of_wedge);
  }

  std::size_t indices() {
    const bool wide = n_ > 65535;  // 65535 itself is not an index: it means "restart"
    const std::vector<std::uint32_t>& in = primitive_.indices;
    const auto as = [&]<class T>(T) {
      return make_stream(
          in.size(), [&](std::size_t i) { return std::array{static_cast<T>(in[i])}; }, sizeof(T));
    };
    const Stream s = wide ? as(std::uint32_t{}) : as(std::uint16_t{});
    return writer_.add_accessor({{"bufferView", add(s, true)},
                                 {"componentType", wide ? 5125 : 5123},
                                 {"count", in.size()},
                                 {"type", "SCALAR"}});
  }

  GlbWriter& writer_;
  const ScaleCoding& coding_;
  const ScalePrimitive& primitive_;
  std::size_t n_;
};

/// The attributes of a primitive under way: what Draco needs to know about each, and what glTF says about it.
class DracoPrimitive {
 public:
  DracoPrimitive(const ScaleCoding& coding, const ScalePrimitive& primitive)
      : coding_(coding), primitive_(primitive), mesh_(primitive.indices, primitive.wedges.size()) {
    add_positions();
    if (!coding.mesh.normals.empty())
      add("NORMAL", "VEC3", {coding.options.normal_bits, {}, 1},
          [&](std::uint32_t w) { return coding.frames.normals[w]; });
    for (int set = 0; set < 2; ++set)
      if (coding.write_uv[set])
        add("TEXCOORD_" + std::to_string(set), "VEC2", draco_grid(coding.uv[set]),
            [&](std::uint32_t w) { return coding.uv_values(set)[w]; });
    if (!coding.mesh.colours.empty()) add_colours();
    if (coding.writes_tangents(primitive))  // from -1 to 1, so that w stays 1 or -1
      add("TANGENT", "VEC4", {coding.options.tangent_bits, {-1, -1, -1}, 2},
          [&](std::uint32_t w) { return coding.frames.tangents[w]; });
    if (primitive.wedge_part.empty()) return;
    mesh_.add("_FEATURE_ID_0", {},
              [&](std::uint32_t i) { return std::array<std::uint16_t, 1>{primitive.wedge_part[i]}; });
    accessors_.push_back(
        {"_FEATURE_ID_0", {{"componentType", kUnsignedShort}, {"count", 0}, {"type", "SCALAR"}}});
  }

  CodedPrimitive code(GlbWriter& writer) {
    const DracoStream stream = mesh_.encode(coding_.draco_speed);
    return {writer.add_draco(stream, std::move(accessors_)), stream.triangles, stream.vertices};
  }

 private:
  static constexpr int kUnsignedByte = 5121, kUnsignedShort = 5123, kFloat = 5126;

  static DracoGrid draco_grid(const QuantisationGrid& grid) { return {grid.bits, grid.origin, grid.range}; }

  /// Floats of the wedges.
  void add(const std::string& name, const char* type, const DracoGrid& grid, const auto& of_wedge) {
    mesh_.add(name, grid, [&](std::uint32_t i) { return of_wedge(primitive_.wedges[i]); });
    accessors_.push_back({name, {{"componentType", kFloat}, {"count", 0}, {"type", type}}});
  }

  void add_positions() {
    const Mesh& m = coding_.mesh;
    Box3f box;
    add("POSITION", "VEC3", draco_grid(coding_.position), [&](std::uint32_t w) {
      const Vec3f p = m.positions[m.wedge_position[w]];
      box.extend(coding_.position.bits > 0 ? coding_.position.rounded(p) : p);
      return p;
    });
    accessors_.back().accessor["min"] = {box.min.x, box.min.y, box.min.z};
    accessors_.back().accessor["max"] = {box.max.x, box.max.y, box.max.z};
  }

  void add_colours() {
    const auto add_as = [&]<class T>(T) {
      mesh_.add("COLOR_0", {}, [&](std::uint32_t i) {
        return coded<T>(numbers_of(coding_.mesh.colours[primitive_.wedges[i]]));
      });
    };
    if (coding_.fine_colours)
      add_as(std::uint16_t{});
    else
      add_as(std::uint8_t{});
    accessors_.push_back({"COLOR_0",
                          {{"componentType", coding_.fine_colours ? kUnsignedShort : kUnsignedByte},
                           {"normalized", true},
                           {"count", 0},
                           {"type", "VEC4"}}});
  }

  const ScaleCoding& coding_;
  const ScalePrimitive& primitive_;
  DracoMesh mesh_;
  std::vector<GlbWriter::DracoAccessor> accessors_;
};

// With fewer a surface is off its own bounds by more than readers may take for damage.
constexpr int kLeastAskedBits = 6;

/// Least bits whose step is at most `step`.
int bits_for(double range, double step) {
  int bits = 1;
  while (bits < 31 && range / static_cast<double>((std::uint64_t{1} << bits) - 1) > step) ++bits;
  return bits;
}

std::vector<float> edge_lengths(const Mesh& mesh) {
  std::vector<float> lengths;
  lengths.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      lengths.push_back(length(mesh.positions[mesh.wedge_position[t[k]]] -
                               mesh.positions[mesh.wedge_position[t[(k + 1) % 3]]]));
  return lengths;
}

/// The least mean edge of a part that can be seen beside the whole (1/4096 of its size, a pixel of a large
/// screen), or 0: a small part under a node of its own scale needs finer steps than the average says.
double finest_part_edge(const Mesh& mesh, double whole) {
  struct Part {
    double edges = 0;
    std::size_t count = 0;
    Box3f box;
  };
  std::vector<Part> parts(mesh.part_names.size());
  for (std::size_t t = 0; t < mesh.triangles.size() && !parts.empty(); ++t) {
    Part& part = parts.at(mesh.triangle_part[t]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f p = mesh.positions[mesh.wedge_position[mesh.triangles[t][k]]];
      const Vec3f q = mesh.positions[mesh.wedge_position[mesh.triangles[t][(k + 1) % 3]]];
      part.box.extend(p);
      part.edges += length(q - p);
      ++part.count;
    }
  }
  double finest = 0;
  for (const Part& part : parts) {
    if (part.count == 0 || part.box.diagonal() * 4096 < whole) continue;
    const double mean = part.edges / static_cast<double>(part.count);
    if (finest == 0 || mean < finest) finest = mean;
  }
  return finest;
}

std::size_t collapsed_triangles(const Mesh& mesh, const std::vector<Triangle>& triangles,
                                const QuantisationGrid& grid) {
  std::size_t count = 0;
  for (const Triangle& t : triangles) {
    const Vec3f a = grid.place(mesh.positions[mesh.wedge_position[t[0]]]);
    const Vec3f b = grid.place(mesh.positions[mesh.wedge_position[t[1]]]);
    const Vec3f c = grid.place(mesh.positions[mesh.wedge_position[t[2]]]);
    const auto [p, q, r] = corner_points(mesh, t);
    if (cross(q - p, r - p) != Vec3d{} &&
        cross(to_double(b) - to_double(a), to_double(c) - to_double(a)) == Vec3d{})
      ++count;
  }
  return count;
}

}  // namespace

bool ScaleCoding::writes_tangents(const ScalePrimitive& primitive) const {
  if (mesh.tangents.empty() || mesh.normals.empty() || !tangents.at(primitive.material)) return false;
  return std::all_of(primitive.wedges.begin(), primitive.wedges.end(),
                     [&](std::uint32_t w) { return mesh.tangents[w].w != 0; });
}

CodedPrimitive code_plain(GlbWriter& writer, const ScaleCoding& coding, ScalePrimitive primitive) {
  if (coding.options.mesh_codec != MeshCodec::kNone) order_for_codec(primitive);
  return PlainPrimitive(writer, coding, primitive).code();
}

CodedPrimitive code_draco(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive) {
  return DracoPrimitive(coding, primitive).code(writer);
}

std::uint32_t QuantisationGrid::index(float x, int axis) const {
  const float scale = static_cast<float>((std::uint32_t{1} << bits) - 1) / range;
  return static_cast<std::uint32_t>(std::max(std::floor((x - origin[axis]) * scale + 0.5f), 0.0f));
}

Vec3f QuantisationGrid::rounded(Vec3f p) const {
  return {value(index(p.x, 0), 0), value(index(p.y, 1), 1), value(index(p.z, 2), 2)};
}

Vec3f QuantisationGrid::place(Vec3f p) const {
  return {static_cast<float>(index(p.x, 0)), static_cast<float>(index(p.y, 1)),
          static_cast<float>(index(p.z, 2))};
}

QuantisationGrid position_grid(const Mesh& mesh, const ScalesOptions& options, int max_bits) {
  QuantisationGrid grid;
  if (mesh.positions.empty()) throw StageError("scales", "mesh", "positions", "none");
  const Box3f box = bounding_box(mesh.positions);
  grid.origin = box.min;
  grid.range = box.longest_side();
  if (!(grid.range > 0)) grid.range = 1;
  if (options.position_bits > 0) {
    grid.bits = std::clamp(options.position_bits, kLeastAskedBits, max_bits);
    return grid;
  }
  std::vector<float> edges = edge_lengths(mesh);
  double sum = 0;
  for (float e : edges) sum += e;
  const std::size_t rank = edges.size() / 20;
  std::nth_element(edges.begin(), edges.begin() + static_cast<std::ptrdiff_t>(rank), edges.end());
  const double error =
      std::min(sum / static_cast<double>(edges.size()) / 16, static_cast<double>(edges[rank]) / 4);
  // The farthest that a point moves is half the diagonal of a cell.
  grid.bits = bits_for(grid.range, error > 0 ? error * 2 / std::sqrt(3.0) : grid.range);
  if (const double part = finest_part_edge(mesh, box.diagonal()); part > 0 && grid.bits <= max_bits)
    grid.bits = std::max(grid.bits, std::min(max_bits, bits_for(grid.range, part / 8 * 2 / std::sqrt(3.0))));
  if (grid.bits <= max_bits) grid.bits = std::max(grid.bits, std::min(max_bits, options.least_position_bits));
  while (grid.bits < max_bits &&
         collapsed_triangles(mesh, mesh.triangles, grid) * 1000 > mesh.triangles.size())
    ++grid.bits;
  if (grid.bits > max_bits) grid.bits = 0;
  return grid;
}

QuantisationGrid uv_grid(const std::vector<Vec2f>& uv, double largest_texture_px,
                         const ScalesOptions& options, int max_bits) {
  QuantisationGrid grid;
  if (uv.empty()) return grid;
  Vec2f lo = uv[0], hi = uv[0];
  for (Vec2f p : uv) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
  }
  grid.origin = {lo.x, lo.y, 0};
  grid.range = std::max(hi.x - lo.x, hi.y - lo.y);
  if (!(grid.range > 0)) grid.range = 1;
  if (options.uv_bits > 0) {
    grid.bits = std::min(options.uv_bits, max_bits);
    return grid;
  }
  const double texels = std::max(largest_texture_px, 1.0);
  if (bits_for(grid.range, 0.5 / texels) > max_bits) return grid;
  grid.bits = std::min(max_bits, std::max(options.least_uv_bits, bits_for(grid.range, 0.25 / texels)));
  return grid;
}

void coarsen(QuantisationGrid& grid, double cells) {
  constexpr int kLeastBits = 7;
  const int bits = std::max(kLeastBits, static_cast<int>(std::ceil(std::log2(std::max(cells, 1.0)))));
  if (grid.bits > 0) grid.bits = std::min(grid.bits, bits);
}

void coarsen_positions(QuantisationGrid& grid, double cells, const Mesh& mesh,
                       const std::vector<Triangle>& triangles) {
  const int finest = grid.bits;
  coarsen(grid, cells);
  while (grid.bits < finest && collapsed_triangles(mesh, triangles, grid) * 10 > triangles.size())
    ++grid.bits;
}

double largest_rounding(const Mesh& mesh, const QuantisationGrid& grid) {
  double largest = 0;
  if (grid.bits == 0) return largest;
  for (Vec3f p : mesh.positions) {
    const Vec3f q = grid.rounded(p);
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(static_cast<double>(q[k]) - p[k]));
  }
  return largest;
}

}  // namespace texmesh
