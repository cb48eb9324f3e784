#include "lab/transfer/packet_loss.h"

#include <algorithm>
#include <cmath>

#include "lab/transfer/chapter_4.h"

namespace texmesh {
namespace {

/// Whether one of the packets of so many bytes gets lost.
bool loses_packet(double bytes, const PacketLoss& loss, TraceRandom& random) {
  bool lost = false;
  for (double left = bytes; left > 0; left -= loss.packet_bytes) lost |= random.uniform() <= loss.loss;
  return lost;
}

double distance(const SplitMesh::Point& a, const SplitMesh::Point& b) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = static_cast<double>(a[k]) - b[k];
    sum += d * d;
  }
  return std::sqrt(sum);
}

double mean_edge(const SplitMesh& mesh) {
  double sum = 0, edges = 0;
  for (const std::uint32_t f : mesh.visible_faces())
    for (std::uint32_t k = 0; k < 3; ++k, ++edges)
      sum += distance(mesh.points()[mesh.point_at(f, k)], mesh.points()[mesh.point_at(f, k + 1)]);
  return edges > 0 ? sum / edges : 1;
}

}  // namespace

std::vector<bool> lost_position_parts(const SplitStreamHead& head, const PacketLoss& loss) {
  TraceRandom random(loss.seed);
  std::vector<bool> lost;
  for (const SplitBlock& b : head.blocks)
    lost.push_back(loses_packet(b.parts[1], loss, random) && !b.is_patch);
  return lost;
}

LossyMesh mesh_with_losses(const SplitStreamHead& head, std::span<const std::uint8_t> stream,
                           std::size_t index, const std::vector<bool>& lost, SplitFill fill) {
  SplitStreamReader reader(head, {}, fill);
  for (std::size_t i = 0; i < head.scales.at(index).blocks; ++i) {
    const SplitBlock& block = head.blocks[i];
    if (block.offset > stream.size() || block.bytes() > stream.size() - block.offset) {
      reader.read_to_scale(index, stream);  // says what is missing
      break;
    }
    std::vector<std::span<const std::uint8_t>> parts;
    auto at = static_cast<std::size_t>(block.offset);
    for (const std::uint32_t size : block.parts) {
      parts.push_back(stream.subspan(at, size));
      at += size;
    }
    if (i < lost.size() && lost[i]) parts[1] = {};
    reader.add_parts(parts);
  }
  if (fill == SplitFill::kTexture) reader.refill_lost_points();
  return {reader.mesh(), reader.lost_points()};
}

PointErrors point_errors(const SplitMesh& whole, const LossyMesh& lossy) {
  PointErrors e;
  std::vector<double> distances;
  for (const std::uint32_t p : lossy.lost_points)
    distances.push_back(distance(whole.points().at(p), lossy.mesh.points().at(p)));
  if (distances.empty()) return e;
  const double edge = mean_edge(whole);
  for (double& d : distances) {
    d /= edge;
    e.rms += d * d;
  }
  e.rms = std::sqrt(e.rms / static_cast<double>(distances.size()));
  std::ranges::sort(distances);
  e.p95 = distances[distances.size() * 95 / 100];
  e.worst = distances.back();
  return e;
}

std::vector<std::int32_t> rungs_after_loss(const std::vector<FragmentOffer>& offers,
                                           std::span<const std::int32_t> rungs, const PacketLoss& loss) {
  TraceRandom random(loss.seed ^ 0x74657874757265ull);  // other packets than the mesh's
  std::vector<std::int32_t> left(rungs.begin(), rungs.end());
  for (std::size_t i = 0; i < left.size(); ++i)
    if (left[i] >= 0 && loses_packet(offers[i].bytes[static_cast<std::size_t>(left[i])], loss, random))
      left[i] = -1;
  return left;
}

}  // namespace texmesh
