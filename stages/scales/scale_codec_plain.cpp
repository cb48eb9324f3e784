#include <meshoptimizer.h>

#include "format/base/box.h"
#include "stages/scales/scale_codecs.h"

namespace texmesh {
namespace {

using Json = GlbWriter::Json;
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

template <class T, std::size_t N, class Value>
Stream make_stream(std::size_t count, std::size_t stride, const Value& value) {
  Stream s{std::vector<std::uint8_t>(count * stride), stride, count};
  for (std::size_t i = 0; i < count; ++i) {
    const std::array<T, N> element = value(i);
    std::memcpy(s.bytes.data() + i * stride, element.data(), sizeof element);
  }
  return s;
}

class PlainPrimitive {
 public:
  PlainPrimitive(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive)
      : writer_(writer), coding_(coding), primitive_(primitive), n_(primitive.wedges.size()) {}

  CodedPrimitive code() {
    CodedPrimitive coded;
    coded.triangles = static_cast<std::uint32_t>(primitive_.indices.size() / 3);
    coded.vertices = static_cast<std::uint32_t>(n_);
    Json& attributes = coded.json["attributes"];
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
    const Stream s = on_grid ? make_stream<std::uint16_t, 3>(n_, 8,
                                                             [&](std::size_t i) {
                                                               const Vec3f q = position(i);
                                                               return std::array<std::uint16_t, 3>{
                                                                   static_cast<std::uint16_t>(q.x),
                                                                   static_cast<std::uint16_t>(q.y),
                                                                   static_cast<std::uint16_t>(q.z)};
                                                             })
                             : make_stream<float, 3>(n_, 12, [&](std::size_t i) {
                                 const Vec3f q = position(i);
                                 return std::array<float, 3>{q.x, q.y, q.z};
                               });
    if (on_grid) writer_.use_extension("KHR_mesh_quantization", true);
    Json accessor{{"bufferView", add(s, false)},
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

  template <class T>
  Stream coded_normals() const {
    constexpr float kOne = std::numeric_limits<T>::max();
    return make_stream<T, 3>(n_, 4 * sizeof(T), [&](std::size_t i) {
      const Vec3f n = coding_.frames.normals[primitive_.wedges[i]];
      auto code = [](float x) {
        return static_cast<T>(std::floor(std::clamp(x, -1.0f, 1.0f) * kOne + 0.5f));
      };
      return std::array<T, 3>{code(n.x), code(n.y), code(n.z)};
    });
  }

  std::size_t normals() {
    const bool fine = coding_.options.normal_bits > 8;
    if (compact()) writer_.use_extension("KHR_mesh_quantization", true);
    const Stream s = !compact() ? make_stream<float, 3>(n_, 12,
                                                        [&](std::size_t i) {
                                                          const Vec3f n =
                                                              coding_.frames.normals[primitive_.wedges[i]];
                                                          return std::array<float, 3>{n.x, n.y, n.z};
                                                        })
                     : fine     ? coded_normals<std::int16_t>()
                                : coded_normals<std::int8_t>();
    Json accessor{{"bufferView", add(s, false)}, {"componentType", !compact() ? 5126 : fine ? 5122 : 5120}};
    if (compact()) accessor["normalized"] = true;
    accessor["count"] = n_;
    accessor["type"] = "VEC3";
    return writer_.add_accessor(std::move(accessor));
  }

  std::size_t parts() {
    const Stream s = make_stream<std::uint16_t, 1>(
        n_, 4, [&](std::size_t i) { return std::array<std::uint16_t, 1>{primitive_.wedge_part[i]}; });
    return writer_.add_accessor(
        {{"bufferView", add(s, false)}, {"componentType", 5123}, {"count", n_}, {"type", "SCALAR"}});
  }

  template <class T>
  Stream coded_tangents() const {
    constexpr float kOne = std::numeric_limits<T>::max();
    return make_stream<T, 4>(n_, 4 * sizeof(T), [&](std::size_t i) {
      const Vec4f t = coding_.frames.tangents[primitive_.wedges[i]];
      auto code = [](float x) {
        return static_cast<T>(std::floor(std::clamp(x, -1.0f, 1.0f) * kOne + 0.5f));
      };
      return std::array<T, 4>{code(t.x), code(t.y), code(t.z), code(t.w)};
    });
  }

  std::size_t tangents() {
    const bool fine = coding_.options.tangent_bits > 8;
    const Stream s = !compact() ? make_stream<float, 4>(n_, 16,
                                                        [&](std::size_t i) {
                                                          const Vec4f t =
                                                              coding_.frames.tangents[primitive_.wedges[i]];
                                                          return std::array<float, 4>{t.x, t.y, t.z, t.w};
                                                        })
                     : fine     ? coded_tangents<std::int16_t>()
                                : coded_tangents<std::int8_t>();
    Json accessor{{"bufferView", add(s, false)}, {"componentType", !compact() ? 5126 : fine ? 5122 : 5120}};
    if (compact()) accessor["normalized"] = true;
    accessor["count"] = n_;
    accessor["type"] = "VEC4";
    return writer_.add_accessor(std::move(accessor));
  }

  /// 16 normalised bits where all coordinates lie in 0..1 and the step is fine enough; floats elsewhere,
  /// because another range would need a texture transform that may clash with the material's own.
  std::size_t uvs(int set) {
    const std::vector<Vec2f>& uv = coding_.uv_values(set);
    const QuantisationGrid& grid = coding_.uv[set];
    const bool unit = compact() && grid.bits > 0 && grid.origin == Vec3f{} && grid.range == 1;
    const Stream s =
        unit ? make_stream<std::uint16_t, 2>(n_, 4,
                                             [&](std::size_t i) {
                                               const Vec2f p = uv[primitive_.wedges[i]];
                                               return std::array<std::uint16_t, 2>{
                                                   static_cast<std::uint16_t>(grid.index(p.x, 0)),
                                                   static_cast<std::uint16_t>(grid.index(p.y, 1))};
                                             })
             : make_stream<float, 2>(n_, 8, [&](std::size_t i) {
                 const Vec2f p = uv[primitive_.wedges[i]];
                 return std::array<float, 2>{p.x, p.y};
               });
    Json accessor{{"bufferView", add(s, false)}, {"componentType", unit ? 5123 : 5126}};
    if (unit) accessor["normalized"] = true;
    accessor["count"] = n_;
    accessor["type"] = "VEC2";
    return writer_.add_accessor(std::move(accessor));
  }

  template <class T>
  Stream coded_colours() const {
    constexpr float kOne = std::numeric_limits<T>::max();
    return make_stream<T, 4>(n_, 4 * sizeof(T), [&](std::size_t i) {
      const Vec4f c = coding_.mesh.colours[primitive_.wedges[i]];
      auto code = [](float x) { return static_cast<T>(std::floor(std::clamp(x, 0.0f, 1.0f) * kOne + 0.5f)); };
      return std::array<T, 4>{code(c.x), code(c.y), code(c.z), code(c.w)};
    });
  }

  std::size_t colours() {
    const Stream s = coding_.fine_colours ? coded_colours<std::uint16_t>() : coded_colours<std::uint8_t>();
    return writer_.add_accessor({{"bufferView", add(s, false)},
                                 {"componentType", coding_.fine_colours ? 5123 : 5121},
                                 {"normalized", true},
                                 {"count", n_},
                                 {"type", "VEC4"}});
  }

  std::size_t indices() {
    const bool wide = n_ > 65535;  // 65535 itself is not an index: it means "restart"
    const std::vector<std::uint32_t>& in = primitive_.indices;
    const Stream s =
        wide ? make_stream<std::uint32_t, 1>(
                   in.size(), 4, [&](std::size_t i) { return std::array<std::uint32_t, 1>{in[i]}; })
             : make_stream<std::uint16_t, 1>(in.size(), 2, [&](std::size_t i) {
                 return std::array<std::uint16_t, 1>{static_cast<std::uint16_t>(in[i])};
               });
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

}  // namespace

CodedPrimitive code_plain(GlbWriter& writer, const ScaleCoding& coding, ScalePrimitive primitive) {
  if (coding.options.mesh_codec != MeshCodec::kNone) order_for_codec(primitive);
  return PlainPrimitive(writer, coding, primitive).code();
}

}  // namespace texmesh
