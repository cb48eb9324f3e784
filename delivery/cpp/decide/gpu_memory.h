#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "delivery/cpp/decide/texture_loss.h"

namespace texmesh {

// What choices take on the GPU, and which choices fit: known from manifest and textures.json before a mesh or
// a fragment is asked for. The browser client counts and chooses the same (decide/memory).

/// How texels are stored: RGBA of 8 bits, or blocks of 4 x 4 texels.
enum class GpuTexels : std::uint8_t {
  kRgba8,
  kBlock8,  // 8 bytes a block: BC1, ETC2 of three channels
  kBlock16  // 16 bytes a block: BC3, BC7, ETC2 of four channels, ASTC 4x4
};
/// Of a texture with all its mip levels, down to one texel.
std::uint64_t gpu_texture_bytes(std::uint32_t width_px, std::uint32_t height_px,
                                GpuTexels texels = GpuTexels::kRgba8);

/// Most bytes of a scale's vertex and index buffers: position, normal, texture coordinates and tangent as
/// 32-bit floats, indices of 32 bits. The browser keeps as many in main memory.
std::uint64_t gpu_mesh_bytes(std::uint32_t vertices, std::uint32_t triangles);

/// What something takes on the GPU at most: vertex and index buffers, and textures with their mip levels as
/// RGBA, for a proxy of all its parts.
struct GpuBytes {
  std::uint64_t mesh = 0, textures = 0;
  std::uint64_t all() const { return mesh + textures; }
};
/// With four textures of its texture_px: the manifest does not say how many it has.
GpuBytes gpu_proxy(const ManifestProxy& proxy);
/// A scale with these planes.
GpuBytes gpu_scale(PackageReader& package, int scale, std::span<const PlaneChoice> planes);

/// `scale`, or the next coarser one whose mesh takes at most half of the memory; the coarsest where none
/// does.
int scale_within(std::span<const ManifestScale> scales, int scale, double most_bytes);

/// The planes, with coarser mips of those textures where a byte less loses least of the picture, until all
/// take at most `most_bytes` or none is coarser.
std::vector<PlaneChoice> planes_within(TextureLoss& loss, std::vector<PlaneChoice> planes, double most_bytes);

}  // namespace texmesh
