#pragma once
#include <memory>

#include "format/model/model.h"
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

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
  void refill_lost_points();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The visible faces of a mesh that a stream has built, with the values that the head's grids give its
/// places. Points and wedges are numbered by their first use. Parts have the numbers of the head's groups and
/// no names.
Mesh split_model(const SplitStreamHead& head, const SplitMesh& mesh);

}  // namespace texmesh
