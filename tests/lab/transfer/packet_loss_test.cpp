// Packets that get lost and are not sent again: what is estimated, and how well.
#include "lab/transfer/packet_loss.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/base/bytes.h"
#include "format/split/split_writer.h"
#include "tests/format/split/split_fixture.h"

namespace texmesh::packet_loss_test {

struct Stream {
  Bytes bytes = write_split_stream(testing::split_fixture(17).source);
  SplitStreamHead head = read_split_head(bytes);
  std::size_t last = head.scales.size() - 1;
  LossyMesh decode(const std::vector<bool>& lost, SplitFill fill) const {
    return mesh_with_losses(head, bytes, last, lost, fill);
  }
};

TEST(PacketLoss, NothingLostIsTheMeshItself) {
  const Stream s;
  SplitStreamReader reader(s.head);
  reader.read_to_scale(s.last, s.bytes);
  for (const SplitFill fill : {SplitFill::kNeighbours, SplitFill::kTexture}) {
    const LossyMesh whole = s.decode(lost_position_parts(s.head, {0, 1460, 1}), fill);
    EXPECT_EQ(whole.mesh.points(), reader.mesh().points());
    EXPECT_TRUE(whole.lost_points.empty());
    EXPECT_EQ(point_errors(reader.mesh(), whole).worst, 0);
  }
}

TEST(PacketLoss, LostPointsAreEstimatedAndPatchesAlwaysCome) {
  const Stream s;
  const std::vector<bool> all = lost_position_parts(s.head, {1, 1460, 1});
  ASSERT_EQ(all.size(), s.head.blocks.size());
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i], !s.head.blocks[i].is_patch) << i;
  const SplitMesh whole = s.decode({}, SplitFill::kNeighbours).mesh;
  const LossyMesh texture = s.decode(all, SplitFill::kTexture),
                  neighbours = s.decode(all, SplitFill::kNeighbours);
  EXPECT_FALSE(texture.lost_points.empty());
  EXPECT_EQ(texture.lost_points, neighbours.lost_points);
  const PointErrors by_texture = point_errors(whole, texture), by_mean = point_errors(whole, neighbours);
  EXPECT_GT(by_texture.rms, 0);
  EXPECT_LT(by_texture.rms, by_mean.rms);  // what the thesis's estimate is worth
  EXPECT_LE(by_texture.p95, by_texture.worst);
  // Points that were not lost after the last block that was lost are where they belong.
  std::vector<bool> first(all.size(), false);
  EXPECT_TRUE(s.decode(first, SplitFill::kTexture).lost_points.empty());
}

TEST(PacketLoss, SharesOfPacketsAndSeeds) {
  SplitStreamHead head;
  for (int i = 0; i < 4000; ++i) {
    SplitBlock block;
    block.parts = {10, i % 2 ? 1000u : 2900u};  // one packet or two
    head.blocks.push_back(block);
  }
  const std::vector<bool> lost = lost_position_parts(head, {0.1, 1460, 5});
  double one = 0, two = 0;
  for (std::size_t i = 0; i < lost.size(); ++i) (i % 2 ? one : two) += lost[i];
  EXPECT_NEAR(one / 2000, 0.1, 0.02);
  EXPECT_NEAR(two / 2000, 0.19, 0.025);
  EXPECT_EQ(lost, lost_position_parts(head, {0.1, 1460, 5}));
  EXPECT_NE(lost, lost_position_parts(head, {0.1, 1460, 6}));
}

TEST(PacketLoss, FragmentsFallBackToTheirPreviews) {
  FragmentOffer offer;
  offer.bytes = {1000, 5000};
  offer.loss = {1, 0.5, 0.1};
  const std::vector<FragmentOffer> offers(500, offer);
  std::vector<std::int32_t> rungs(500, 1);
  for (std::size_t i = 0; i < 500; i += 2) rungs[i] = i % 4 ? 0 : -1;
  EXPECT_EQ(rungs_after_loss(offers, rungs, {0, 1460, 1}), rungs);
  const std::vector<std::int32_t> some = rungs_after_loss(offers, rungs, {0.1, 1460, 1});
  int small = 0, large = 0;
  for (std::size_t i = 0; i < 500; ++i) {
    EXPECT_TRUE(some[i] == rungs[i] || some[i] == -1);
    if (rungs[i] >= 0 && some[i] < 0) ++(rungs[i] == 0 ? small : large);
  }
  EXPECT_NEAR(small / 125.0, 0.1, 0.08);
  EXPECT_NEAR(large / 250.0, 1 - 0.9 * 0.9 * 0.9 * 0.9, 0.08);
  const std::vector<std::int32_t> none = rungs_after_loss(offers, rungs, {1, 1460, 1});
  EXPECT_EQ(std::ranges::count(none, -1), 500);
}

TEST(PacketLoss, AStreamThatEndsIsRefused) {
  const Stream s;
  const std::span<const std::uint8_t> cut(s.bytes.data(), s.bytes.size() - 1);
  EXPECT_ANY_THROW(mesh_with_losses(s.head, cut, s.last, {}, SplitFill::kTexture));
}

}  // namespace texmesh::packet_loss_test
