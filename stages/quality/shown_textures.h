#pragma once
// Inside the room only: which textures show, and what of them pictures of one size need.
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/render/visibility.h"

namespace texmesh::quality {

inline constexpr std::uint32_t kMaxFirstLevel = 4;  // fragments' sides are multiples of 16

/// A texture that materials read: a full-size plane, with the plane of its alpha where there is one.
struct ShownTexture {
  std::uint32_t plane = 0;  // index into Fragments::planes
  std::optional<std::uint32_t> alpha;
  bool srgb = false;
  bool with_mips = true;  // false where a sampler of the source's reads level 0 alone
};

struct ShownTextures {
  std::vector<ShownTexture> textures;
  std::vector<RenderMaterial> materials;  // their slots count `textures`, and read all with mips
  std::vector<RenderMaterial> sampled;    // the same, as the source's samplers read
  bool with_mips() const { return std::ranges::all_of(textures, &ShownTexture::with_mips); }
};

/// What the reference renderer reads. References to coordinates that the mesh does not have, all but the base
/// colour of unlit materials, and the emission of materials that emit nothing do not show.
ShownTextures find_shown(const std::vector<Material>& materials, const Fragments& fragments,
                         const Mesh& mesh);

/// Per shown texture, the finest mip that more than 2 % of its fragments in pictures ask for.
class LevelCount {
 public:
  explicit LevelCount(std::size_t textures) : wanted_(textures) {}
  /// A view of S_0 that stands for one so many times as large. `sizes`: width and height of each texture, px.
  void add(const RenderScene& scene, const Visibility& view, const std::vector<Vec2<std::uint32_t>>& sizes,
           double magnification);
  /// At most kMaxFirstLevel each.
  std::vector<std::uint32_t> first_levels() const;

 private:
  std::vector<std::array<std::uint64_t, kMaxFirstLevel + 1>> wanted_;
};

}  // namespace texmesh::quality
