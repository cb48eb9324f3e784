#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

/// The stream's own version, which may stay while that of packages moves.
inline constexpr int kSplitStreamMajor = 2, kSplitStreamMinor = 0;

// mesh/stream.bin: the model from its coarsest kept scale to S_0 as vertex splits (SPEC.md, section Split
// stream; after Hoppe's progressive meshes and thesis 10). A head says what the stream holds and where each
// block of some hundred splits stands; every block has one part for connectivity, one for positions and one
// per attribute. Connectivity must be there; any other part may be left out.

enum class SplitKind : std::uint8_t { kUv0 = 0, kUv1 = 1, kNormal = 2, kColour = 3 };
constexpr int split_components(SplitKind kind) { return kind == SplitKind::kColour ? 4 : 2; }

/// value = float(place) * step + origin, in single precision, operation by operation.
struct SplitGrid {
  int bits = 1;  // 1 to 24
  std::array<float, 3> origin{};
  float range = 1;  // side of the cube of places, > 0
  float step() const { return range / static_cast<float>((std::uint32_t{1} << bits) - 1); }
  float value(std::int32_t place, int axis) const {
    return static_cast<float>(place) * step() + origin[static_cast<std::size_t>(axis)];
  }
  friend bool operator==(const SplitGrid&, const SplitGrid&) = default;
};

/// UV: places on the grid. Normals: octahedral, both numbers 0 .. 2^bits - 2 (see octahedral_normal).
/// Colours: 0 .. 2^bits - 1 for 0 .. 1.
struct SplitAttribute {
  SplitKind kind = SplitKind::kUv0;
  SplitGrid grid;  // of normals and colours only the bits count
  friend bool operator==(const SplitAttribute&, const SplitAttribute&) = default;
};

/// What triangles of one kind have in common.
struct SplitGroup {
  std::uint16_t material = 0, part = 0;
  friend bool operator==(const SplitGroup&, const SplitGroup&) = default;
};

/// A scale that the stream passes: complete after its first `blocks` blocks, with these counts. Triangles
/// are those with three different places (visible_faces); faces are all.
struct SplitScale {
  int scale = 0;
  std::uint32_t blocks = 0, points = 0, wedges = 0, faces = 0, triangles = 0;
  friend bool operator==(const SplitScale&, const SplitScale&) = default;
};

struct SplitBlock {
  bool is_patch = false;                 // adds faces, otherwise splits points
  std::uint32_t count = 0;               // of faces or splits
  std::uint64_t offset = 0;              // of its first part in the stream
  std::vector<std::uint32_t> parts;      // bytes of connectivity, positions, attributes, one after the other
  std::array<std::uint8_t, 8> digest{};  // the first bytes of the SHA-256 of the whole block
  std::uint64_t bytes() const;
};

struct SplitStreamHead {
  SplitGrid position;
  std::vector<SplitAttribute> attributes;  // at most one of each kind, rising
  std::vector<SplitGroup> groups;          // at least one
  std::vector<SplitScale> scales;          // coarsest first, S_0 last
  std::vector<SplitBlock> blocks;
  std::vector<std::vector<std::uint8_t>> models;  // per value part: where its probabilities start
  std::uint64_t bytes = 0;                        // of the head itself
};

/// Direction of an octahedral normal, unit length.
std::array<float, 3> octahedral_normal(std::int32_t u, std::int32_t v, int bits);
/// Nearest of the four octahedral codes around a direction; {centre, centre} (= +z) for a zero vector.
std::array<std::int32_t, 2> octahedral_code(std::array<float, 3> normal, int bits);

/// The head, from a stream or the first bytes of it. Everything is checked that can be without the blocks.
SplitStreamHead read_split_head(std::span<const std::uint8_t> bytes);

/// Bytes of the stream up to and including a scale's last block, the head among them. FormatError when the
/// stream does not pass the scale.
std::uint64_t split_prefix_bytes(const SplitStreamHead& head, int scale);

/// What a reader is willing to hold; a stream that goes beyond is refused.
struct SplitLimits {
  std::uint32_t points = 1u << 27, faces = 1u << 28, wedges = 3u << 28;
};

}  // namespace texmesh
