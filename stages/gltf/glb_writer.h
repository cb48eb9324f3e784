#pragma once
// The bitstreams of EXT_meshopt_compression without filters: attributes of version 0, triangles of version 1.
#include <nlohmann/json.hpp>

#include "stages/gltf/draco_mesh.h"

namespace texmesh {

/// A glTF 2.0 document that grows, written as a GLB: scales, proxies and what debug views show.
class GlbWriter {
 public:
  using Json = nlohmann::ordered_json;
  /// An attribute's name and its accessor, whose count and data come from a Draco stream.
  struct DracoAccessor {
    std::string name;
    Json accessor;
  };

  GlbWriter();
  ~GlbWriter();
  GlbWriter(const GlbWriter&) = delete;
  GlbWriter& operator=(const GlbWriter&) = delete;

  /// Appends to the binary chunk at a multiple of 4 bytes; returns the buffer view's index.
  std::size_t add_view(std::span<const std::uint8_t> bytes, std::size_t stride = 0, int target = 0);
  /// Appends to the binary chunk without a view; returns the byte offset.
  std::size_t add_bytes(std::span<const std::uint8_t> bytes);
  /// A view of EXT_meshopt_compression: `packed` decodes to `count` elements of `stride` bytes, of triangles
  /// or of attributes. What it stands for lies in a fallback buffer that holds nothing.
  std::size_t add_meshopt_view(std::span<const std::uint8_t> packed, std::size_t count, std::size_t stride,
                               bool is_index, int target = 0);
  std::size_t add_accessor(Json accessor);
  /// A primitive of KHR_draco_mesh_compression without its material.
  Json add_draco(const DracoStream& stream, std::vector<DracoAccessor> attributes);
  /// Adds to extensionsUsed, and to extensionsRequired where a reader must know it.
  void use_extension(const std::string& name, bool required);

  /// Materials, textures, images, samplers, meshes, nodes: arrays that the caller fills.
  Json& array(const std::string& name);
  /// Whether there are views of EXT_meshopt_compression.
  bool uses_meshopt() const { return fallback_bytes_ > 0; }

  /// The file. JSON keys in a fixed order, no blanks, shortest numbers: the same document gives
  /// the same bytes.
  std::vector<std::uint8_t> finish() const;

  /// A number that prints as the shortest decimal that is this float again.
  static double shortest(float x);
  /// A list of such numbers.
  static Json shortest(std::initializer_list<float> numbers);
  static Json shortest(Vec3f v) { return shortest({v.x, v.y, v.z}); }

 private:
  struct Elements;
  std::size_t add_json_view(Json view);
  std::unique_ptr<Elements> elements_;
  std::vector<std::uint8_t> bin_;
  std::vector<std::string> used_, required_;
  std::size_t fallback_bytes_ = 0;
};

/// `count` elements of `stride` bytes each (a multiple of 4, at most 256). `stage` is named by the StageError
/// of a stream that cannot be made.
std::vector<std::uint8_t> meshopt_attributes(std::span<const std::uint8_t> bytes, std::size_t count,
                                             std::size_t stride, const char* stage);

/// Triangles of `vertices` vertices; indices are a multiple of 3.
std::vector<std::uint8_t> meshopt_triangles(std::span<const std::uint32_t> indices, std::size_t vertices,
                                            const char* stage);

}  // namespace texmesh
