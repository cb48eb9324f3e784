#pragma once
// Inside the room only: what of a size is rendered, since the rest follows from other sizes.
//
// Samplers that read level 0 alone have rules of their own: their texels flicker where they are smaller than
// pixels. What is lost there is a matter of chance, so it follows neither from a smaller size nor from
// pictures of the same texels read with mips.
#include <cstddef>
#include <vector>

#include "stages/quality/quality.h"
#include "stages/quality/size_cells.h"

namespace texmesh::quality {

inline constexpr std::size_t kSizes = 3;  // that show textures

/// How often the largest height is halved for pictures of textures, below kSizes. Beyond the height at which
/// texels are as large as pixels and triangles as large as 16 pixels, pictures are enlarged ones: what they
/// lose follows (enlarge()). `triangles` of the finest scale.
std::size_t fewer_heights(const TextureSampler& sampler, std::size_t triangles, double object_height,
                          const QualityOptions& options);

/// Whether scales, which are looked at with mips, and textures, which are looked at as samplers read them,
/// are compared with the same pictures.
bool have_one_reference(const ShownTextures& shown);

/// Short ladders have no other rung.
bool repeats(const Knot& knot, const Knot& before);

/// The knots that are rendered: all, at larger sizes that of the lowest rung, and at the half that of the
/// highest one: from a mip with a single rung, as small sizes show it, nothing follows for another mip's best
/// rung. Without mips losses do not follow from smaller sizes.
bool is_sampled(const TextureSampler& sampler, const std::vector<Knot>& knots, std::size_t knot,
                std::size_t rank);

/// Levels of source's texels that are rendered.
struct MipSamples {
  std::size_t finer = 0, coarser = 0;
};
/// At larger heights the planes that are shown, and the next coarser ones where textures have no finer planes
/// for them, and once for all. Without mips all at every height.
MipSamples mip_samples(const TextureSampler& sampler, std::size_t rank, const Display& display,
                       const PlanesOfGroup& group);

}  // namespace texmesh::quality
