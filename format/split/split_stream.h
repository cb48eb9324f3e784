#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "format/split/split_mesh.h"

namespace texmesh {

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

/// What write_split_stream needs, in the caller's numbers of points, wedges and faces.
struct SplitSource {
  struct Face {
    std::uint32_t face = 0;
    std::array<std::uint32_t, 3> wedges{};
  };
  /// The corner of `face` at the parent goes to the child and gets this wedge.
  struct Move {
    std::uint32_t face = 0, wedge = 0;
  };
  struct Split {
    std::uint32_t parent = 0, child = 0;
    std::uint32_t move_begin = 0, move_end = 0;  // in Chapter::moves
    std::uint32_t born_begin = 0, born_end = 0;  // in Chapter::born; each with a corner at parent and child
  };
  /// From one scale to the next finer one. First the patch, then the splits, in any order in which each
  /// comes after those it depends on.
  struct Chapter {
    int scale = 0;  // that it leads to
    std::vector<Face> patch;
    std::vector<Split> splits;
    std::vector<Move> moves;
    std::vector<Face> born;
    std::vector<std::array<std::uint32_t, 2>> before;  // {a, b}: split a comes before split b
  };
  SplitGrid position;
  std::vector<SplitAttribute> attributes;
  std::vector<SplitGroup> groups;
  std::vector<SplitMesh::Point> points;
  std::vector<std::uint32_t> wedge_point;
  std::vector<std::vector<std::int32_t>> values;  // per attribute: components * wedges
  std::vector<std::uint16_t> face_group;          // per face
  std::vector<Chapter> chapters;                  // the first has a patch only: the coarsest scale
  std::uint32_t splits_per_block = 512;           // 1 to 4096
};

/// Same bytes for the same source. FormatError when the source contradicts itself: splits that wait for each
/// other, faces that are not at their parent, indices or numbers out of range.
std::vector<std::uint8_t> write_split_stream(const SplitSource& source);

/// The head, from a stream or the first bytes of it. Everything is checked that can be without the blocks.
SplitStreamHead read_split_head(std::span<const std::uint8_t> bytes);

/// What a reader is willing to hold; a stream that goes beyond is refused.
struct SplitLimits {
  std::uint32_t points = 1u << 27, faces = 1u << 28;
};

/// Where a point goes whose part of positions was lost (thesis ch. 10). kNeighbours: to the mean of its
/// neighbours. kTexture: to where its texture coordinates lie among those of its neighbours, by a weighted
/// affine fit; where it has none, or they say nothing, to the mean. The affine fit takes 32-bit places in
/// double arithmetic, the same bits everywhere.
enum class SplitFill : std::uint8_t { kNeighbours, kTexture };

/// Builds the mesh, block by block. Memory grows with what has been decoded: about 60 bytes per face.
class SplitStreamReader {
 public:
  explicit SplitStreamReader(SplitStreamHead head, SplitLimits limits = {},
                             SplitFill fill = SplitFill::kNeighbours);
  ~SplitStreamReader();
  SplitStreamReader(SplitStreamReader&&) noexcept;
  SplitStreamReader& operator=(SplitStreamReader&&) noexcept;

  const SplitStreamHead& head() const;
  const SplitMesh& mesh() const;
  std::size_t next_block() const;  // number of blocks decoded so far
  /// The next block, digest checked. FormatError when it is not what the head says; the reader is then of
  /// no more use.
  void add_block(std::span<const std::uint8_t> block);
  /// The next block's parts, connectivity first, nothing checked but their sizes; those behind it may be
  /// empty spans where they were left out: then their values are what the neighbours suggest.
  void add_parts(std::span<const std::span<const std::uint8_t>> parts);
  /// Blocks up to and including a scale's last one, from the bytes of the whole stream.
  void read_to_scale(std::size_t index, std::span<const std::uint8_t> stream);
  /// Points whose part of positions was lost.
  const std::vector<std::uint32_t>& lost_points() const;
  /// Moves them anew, now that finer neighbours are known, in the order in which they were made. Only after
  /// a scale's last block, and nothing may be added afterwards: the positions of later blocks count from what
  /// was there when they were written.
  void fill_again();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace texmesh
