#pragma once
// Inside the ladder only: what loads can get of a texture's pairs.
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "stages/ladder/rung_value.h"

namespace texmesh::rungs {

/// 1 - SSIM that nobody sees: a rung that saves half of less is not worth twice as much.
inline constexpr double kUnseen = 0.01;
/// The preview, where pairs are numbered.
inline constexpr std::size_t kPreview = std::numeric_limits<std::size_t>::max();

/// A vertex of a lower hull.
struct Vertex {
  std::size_t pair = kPreview;
  double bytes = 0, loss = 0;
};
using Hull = std::vector<Vertex>;

/// Levels of a texture, the last one included.
struct Levels {
  std::size_t first = 0, last = 0;
};

/// What loads give a texture: bytes, by wanted level.
using GivenBytes = std::vector<std::vector<double>>;

/// The lower hull of loss over bytes where a level is wanted: from the preview on along the kept pairs of
/// some levels.
Hull hull_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep, std::size_t wanted,
             Levels levels);
/// Those of the wanted level and of each coarser one.
std::vector<Hull> hulls_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                           std::size_t wanted);
/// The vertex at or behind which so many bytes end.
std::size_t segment_of(const Hull& hull, double bytes);
/// Some fragments at one vertex and the others at the next one.
double loss_at(const Hull& hull, double bytes);
/// The hull that loses least with so many bytes: clients show one level of a texture.
std::size_t best_of(const std::vector<Hull>& hulls, double bytes);

/// Of all kept pairs together.
double bytes_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep);

}  // namespace texmesh::rungs
