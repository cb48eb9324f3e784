#pragma once

#include "delivery/cpp/decide/harmonic_time.h"
#include "format/split/split_reader.h"

namespace texmesh {

/// Packets that get lost and are not sent again (thesis ch. 10). HTTP loses none: this is what a transport
/// without repetition would cost. A part that takes several packets is lost with any of them.
struct PacketLoss {
  double loss = 0;             // of a packet, 0 .. 1
  double packet_bytes = 1460;  // > 0
  std::uint64_t seed = 1;
};

/// Which blocks lose their part of positions, one decision for each of the head's blocks. Connectivity,
/// texture coordinates and patches always come: they are small, and without them nothing can be estimated.
/// (The thesis sends vertices and texels in separate packets.)
std::vector<bool> lost_position_parts(const SplitStreamHead& head, const PacketLoss& loss);

/// What the mesh of a stream's scale becomes.
struct LossyMesh {
  SplitMesh mesh;
  std::vector<std::uint32_t> lost_points;  // whose place is an estimate
};
/// The mesh up to head.scales[index]; `lost` empty: nothing is lost. kTexture places lost points by their
/// texture coordinates, again when all neighbours are known. FormatError for a damaged stream.
LossyMesh mesh_with_losses(const SplitStreamHead& head, std::span<const std::uint8_t> stream,
                           std::size_t index, const std::vector<bool>& lost, SplitFill fill);

/// How far lost points are from where they belong, in mean edges of the mesh as it should be.
struct PointErrors {
  double rms = 0, p95 = 0, worst = 0;
};
PointErrors point_errors(const SplitMesh& whole, const LossyMesh& lossy);

/// Rungs by offer after losses: a fragment of which a packet is lost falls back to its preview (-1).
std::vector<std::int32_t> rungs_after_loss(const std::vector<FragmentOffer>& offers,
                                           std::span<const std::int32_t> rungs, const PacketLoss& loss);

}  // namespace texmesh
