#pragma once
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

/// A glTF 2.0 document that grows: what the scales stage needs of the format, written as a GLB.
class GlbWriter {
 public:
  using Json = nlohmann::ordered_json;

  GlbWriter();
  ~GlbWriter();
  GlbWriter(const GlbWriter&) = delete;
  GlbWriter& operator=(const GlbWriter&) = delete;

  /// Appends to the binary chunk at a multiple of 4 bytes; returns the buffer view's index.
  std::size_t add_view(std::span<const std::uint8_t> bytes, std::size_t stride = 0, int target = 0);
  /// Appends to the binary chunk without a view; returns the byte offset.
  std::size_t add_bytes(std::span<const std::uint8_t> bytes);
  std::size_t add_json_view(Json view);
  std::size_t add_accessor(Json accessor);
  /// Adds to extensionsUsed, and to extensionsRequired where a reader must know it.
  void use_extension(const std::string& name, bool required);

  /// Materials, textures, images, samplers, meshes, nodes: arrays that the caller fills.
  Json& array(const std::string& name);
  /// A second buffer of this size that holds nothing (EXT_meshopt_compression's fallback); 0 = none.
  void set_fallback_buffer(std::size_t bytes) { fallback_bytes_ = bytes; }

  /// The file. JSON keys in a fixed order, no blanks, shortest numbers: the same document gives
  /// the same bytes.
  std::vector<std::uint8_t> finish() const;

  /// A number that prints as the shortest decimal that is this float again.
  static double shortest(float x);

 private:
  struct Elements;
  std::unique_ptr<Elements> elements_;
  std::vector<std::uint8_t> bin_;
  std::vector<std::string> used_, required_;
  std::size_t fallback_bytes_ = 0;
};

}  // namespace texmesh
