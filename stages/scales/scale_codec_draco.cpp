
#include "format/base/box.h"
#include "stages/scales/scale_codecs.h"

namespace texmesh {
namespace {

using Json = GlbWriter::Json;

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
    const DracoStream stream = mesh_.encode(10 - coding_.options.draco_level);
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

  template <class Element>
  void add_colour_values() {
    constexpr float kOne = std::numeric_limits<Element>::max();
    mesh_.add("COLOR_0", {}, [&](std::uint32_t i) {
      const Vec4f c = coding_.mesh.colours[primitive_.wedges[i]];
      const auto code = [](float x) {
        return static_cast<Element>(std::floor(std::clamp(x, 0.0f, 1.0f) * kOne + 0.5f));
      };
      return std::array<Element, 4>{code(c.x), code(c.y), code(c.z), code(c.w)};
    });
  }

  void add_colours() {
    if (coding_.fine_colours)
      add_colour_values<std::uint16_t>();
    else
      add_colour_values<std::uint8_t>();
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

}  // namespace

CodedPrimitive code_draco(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive) {
  return DracoPrimitive(coding, primitive).code(writer);
}

}  // namespace texmesh
