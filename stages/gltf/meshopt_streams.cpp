#include "stages/gltf/meshopt_streams.h"

#include <meshoptimizer.h>

#include "format/base/errors.h"

namespace texmesh {

namespace {

std::vector<std::uint8_t> of_size(std::vector<std::uint8_t> packed, std::size_t size, const char* stage) {
  if (size == 0) throw StageError(stage, "meshopt", "a compressed stream", "nothing");
  packed.resize(size);
  return packed;
}

}  // namespace

std::vector<std::uint8_t> meshopt_attributes(std::span<const std::uint8_t> bytes, std::size_t count,
                                             std::size_t stride, const char* stage) {
  std::vector<std::uint8_t> packed(meshopt_encodeVertexBufferBound(count, stride));
  const std::size_t size =
      meshopt_encodeVertexBuffer(packed.data(), packed.size(), bytes.data(), count, stride);
  return of_size(std::move(packed), size, stage);
}

std::vector<std::uint8_t> meshopt_triangles(std::span<const std::uint32_t> indices, std::size_t vertices,
                                            const char* stage) {
  // The extension asks for version 1, but the library writes 0 until told otherwise, once for the process.
  static const bool version_1 = [] {
    meshopt_encodeIndexVersion(1);
    return true;
  }();
  static_cast<void>(version_1);
  std::vector<std::uint8_t> packed(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  const std::size_t size =
      meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), indices.size());
  return of_size(std::move(packed), size, stage);
}

}  // namespace texmesh
