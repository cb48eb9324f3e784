#pragma once

#include "delivery/cpp/decide/fragment_list.h"

namespace texmesh {

// What choices take on the GPU, and which choices fit: known from manifest and textures.json before a mesh or
// a fragment is asked for. The browser client counts and chooses the same (decide/memory).

/// Of a texture with all its mip levels, down to one texel, as RGBA of 8 bits.
std::uint64_t gpu_texture_bytes(std::uint32_t width_px, std::uint32_t height_px);

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

/// The best texture that so many bytes can show.
struct TextureBudget {
  std::vector<PlaneChoice> planes;
  FragmentList list;
  std::vector<std::int32_t> rungs;  // by offer; -1 = skipped
  std::uint64_t bytes = 0;          // of fragments, at most the budget
  PerGroup losses{};                // of each group by itself
  double flip = 0;                  // of the picture with the scale
};

/// Chooses between the planes for the display and coarser and finer ones, so that few bytes are not spread
/// over too many texels, and bytes that are left show what a mean of texels per pixel hides. Spends the bytes
/// on fragments by rate and distortion (spend_bytes). What counts is the FLIP that is predicted of the
/// picture with ListOptions::scale. Finer planes, which take memory, must look better, not only as good.
///
/// Bytes are first spent by the sum of the groups' losses (ListOptions::group_weights = 1). Losses add up as
/// QualityTable::exponent says, so the groups' weights become those of that sum's slope where the bytes were
/// spent, and the bytes are spent again; the better choice stays. FragmentList::group_weights has its
/// weights.
///
/// `loss` is for options.displayed_px. Where the planes take more than `memory_bytes` on the GPU, coarser
/// mips take their places (planes_within), and the bytes are spent on these.
TextureBudget texture_for_budget(TextureLoss& loss, const ListOptions& options, std::uint64_t bytes,
                                 double memory_bytes = std::numeric_limits<double>::infinity());

}  // namespace texmesh
