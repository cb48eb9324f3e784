#include "format/split/split_stream.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "tests/format/split/split_fixture.h"
#include "tests/support/face_wedges.h"

namespace texmesh::split_stream_test {

using testing::corners_of;
using testing::face_wedges;
using testing::split_fixture;
using testing::SplitFixture;
std::span<const std::uint8_t> block_of(const SplitStreamHead& head, const Bytes& stream, std::size_t i) {
  return std::span(stream).subspan(head.blocks[i].offset, head.blocks[i].bytes());
}

std::vector<std::span<const std::uint8_t>> parts_of(const SplitStreamHead& head, const Bytes& stream,
                                                    std::size_t i) {
  std::vector<std::span<const std::uint8_t>> parts;
  std::size_t at = 0;
  for (const std::uint32_t size : head.blocks[i].parts) {
    parts.push_back(block_of(head, stream, i).subspan(at, size));
    at += size;
  }
  return parts;
}

/// Indices in range, three points per face, no edge with more than two faces, none twice in one direction.
void expect_manifold(const SplitMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f) {
    for (std::uint32_t k = 0; k < 3; ++k) {
      ASSERT_LT(mesh.wedge_at(f, k), mesh.wedge_point().size());
      ASSERT_LT(mesh.point_at(f, k), mesh.points().size());
      ASSERT_NE(mesh.point_at(f, k), mesh.point_at(f, k + 1));
      ASSERT_EQ(++edges[std::pair(mesh.point_at(f, k), mesh.point_at(f, k + 1))], 1);
    }
  }
}

TEST(SplitStream, EveryScaleComesBackAndEveryBlockLeavesAManifold) {
  for (const std::uint32_t n : {3u, 5u, 9u, 17u}) {
    const SplitFixture fixture = split_fixture(n);
    const Bytes stream = write_split_stream(fixture.source);
    const SplitStreamHead head = read_split_head(stream);
    ASSERT_EQ(head.scales.size(), fixture.scales.size());
    EXPECT_EQ(head.position, fixture.source.position);
    EXPECT_EQ(head.attributes, fixture.source.attributes);
    EXPECT_EQ(head.groups, fixture.source.groups);
    EXPECT_EQ(head.blocks.back().offset + head.blocks.back().bytes(), stream.size());
    SplitStreamReader reader(head);
    std::size_t scale = 0;
    for (std::size_t i = 0; i < head.blocks.size(); ++i) {
      reader.add_block(block_of(head, stream, i));
      expect_manifold(reader.mesh());
      if (i + 1 != head.scales[scale].blocks) continue;
      EXPECT_EQ(corners_of(reader.mesh()), fixture.scales[scale]) << "scale " << head.scales[scale].scale;
      EXPECT_EQ(head.scales[scale].triangles, fixture.scales[scale].size());
      ++scale;
    }
    EXPECT_EQ(scale, head.scales.size());
    EXPECT_THROW(reader.add_block({}), FormatError);
  }
}

TEST(SplitStream, BlocksHoldAsManySplitsAsAskedFor) {
  SplitFixture fixture = split_fixture();
  for (const std::uint32_t size : {1u, 5u, 4096u}) {
    fixture.source.splits_per_block = size;
    const Bytes stream = write_split_stream(fixture.source);
    const SplitStreamHead head = read_split_head(stream);
    for (const SplitBlock& b : head.blocks)
      if (!b.is_patch) EXPECT_LE(b.count, size);
    SplitStreamReader reader(head);
    reader.read_to_scale(head.scales.size() - 1, stream);
    EXPECT_EQ(corners_of(reader.mesh()), fixture.scales.back());
    EXPECT_EQ(write_split_stream(fixture.source), stream);
  }
}

TEST(SplitStream, ValuesMayBeLeftOutPartByPart) {
  const SplitFixture fixture = split_fixture(17);
  const Bytes stream = write_split_stream(fixture.source);
  const SplitStreamHead head = read_split_head(stream);
  SplitStreamReader whole(head);
  whole.read_to_scale(head.scales.size() - 1, stream);
  for (std::size_t dropped = 1; dropped < head.blocks[0].parts.size(); ++dropped) {
    SplitStreamReader reader(head);
    for (std::size_t i = 0; i < head.blocks.size(); ++i) {
      auto parts = parts_of(head, stream, i);
      if (i % 3 == 1 && !head.blocks[i].is_patch) parts[dropped] = {};
      reader.add_parts(parts);
    }
    const SplitMesh &a = whole.mesh(), &b = reader.mesh();
    EXPECT_EQ(face_wedges(a), face_wedges(b));
    EXPECT_EQ(a.points() == b.points(), dropped != 1);
    for (std::size_t k = 0; k < a.attributes(); ++k)
      EXPECT_EQ(a.values(k) == b.values(k), dropped != k + 2) << "attribute " << k << ", part " << dropped;
    // What is filled in comes from the neighbours, so it is not far off.
    if (dropped != 1) continue;
    double worst = 0;
    for (std::size_t p = 0; p < a.points().size(); ++p)
      for (std::size_t k = 0; k < 3; ++k)
        worst = std::max(worst, std::fabs(static_cast<double>(a.points()[p][k] - b.points()[p][k])));
    EXPECT_LT(worst, 640);
  }
}

TEST(SplitStream, RefusesEveryTruncation) {
  const SplitFixture fixture = split_fixture(5);
  const Bytes stream = write_split_stream(fixture.source);
  const SplitStreamHead head = read_split_head(stream);
  for (std::size_t length = 0; length < stream.size(); ++length) {
    const std::span<const std::uint8_t> part = std::span(stream).first(length);
    if (length < head.bytes) {
      EXPECT_THROW(read_split_head(part), FormatError) << length;
      continue;
    }
    SplitStreamReader reader(read_split_head(part));
    EXPECT_THROW(reader.read_to_scale(head.scales.size() - 1, part), FormatError) << length;
    expect_manifold(reader.mesh());  // the whole blocks before the end
  }
}

TEST(SplitStream, FlippedBytesAreFoundOrHarmless) {
  const SplitFixture fixture = split_fixture(5);
  const Bytes stream = write_split_stream(fixture.source);
  const std::uint64_t head_bytes = read_split_head(stream).bytes;
  for (std::size_t at = 0; at < stream.size(); ++at)
    for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
      Bytes broken = stream;
      broken[at] ^= flip;
      try {
        const SplitStreamHead head = read_split_head(broken);
        SplitStreamReader reader(head, {1000, 2000});
        reader.read_to_scale(head.scales.size() - 1, broken);
        EXPECT_LT(at, head_bytes) << "a block with another byte was taken";
      } catch (const FormatError&) {
      }
    }
}

/// Without digests: whatever the bytes of the parts are, the reader ends with a mesh of bounded size or says
/// FormatError.
TEST(SplitStream, AnyPartsDecodeWithinBounds) {
  const SplitFixture fixture = split_fixture(9);
  const Bytes stream = write_split_stream(fixture.source);
  const SplitStreamHead head = read_split_head(stream);
  std::uint64_t state = 1;
  const auto random = [&state](std::uint32_t n) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::uint32_t>((state >> 33) % n);
  };
  std::size_t survived = 0;
  for (int round = 0; round < 400; ++round) {
    Bytes broken = stream;
    const std::size_t changes = 1 + random(40);
    for (std::size_t i = 0; i < changes; ++i) {
      const std::size_t at = head.bytes + random(static_cast<std::uint32_t>(stream.size() - head.bytes));
      broken[at] = static_cast<std::uint8_t>(round % 3 == 0 ? 0 : round % 3 == 1 ? 0xff : random(256));
    }
    SplitStreamReader reader(head);
    try {
      for (std::size_t i = 0; i < head.blocks.size(); ++i) reader.add_parts(parts_of(head, broken, i));
      ++survived;
    } catch (const FormatError&) {
    }
    EXPECT_LE(reader.mesh().points().size(), head.scales.back().points);
    EXPECT_LE(reader.mesh().face_count(), head.scales.back().faces);
    for (std::uint32_t f = 0; f < reader.mesh().face_count(); ++f)
      for (std::uint32_t k = 0; k < 3; ++k)
        ASSERT_LT(reader.mesh().point_at(f, k), reader.mesh().points().size());
    for (const auto& p : reader.mesh().points())
      for (const std::int32_t x : p) ASSERT_TRUE(x >= 0 && x < (1 << head.position.bits));
  }
  EXPECT_LT(survived, 400u);
}

TEST(SplitStream, KeepsToTheReadersLimits) {
  const SplitFixture fixture = split_fixture();
  const SplitStreamHead head = read_split_head(write_split_stream(fixture.source));
  const SplitScale& last = head.scales.back();
  EXPECT_NO_THROW(SplitStreamReader(head, {last.points, last.faces, last.wedges}));
  EXPECT_THROW(SplitStreamReader(head, {last.points - 1, last.faces, last.wedges}), FormatError);
  EXPECT_THROW(SplitStreamReader(head, {last.points, last.faces - 1, last.wedges}), FormatError);
  EXPECT_THROW(SplitStreamReader(head, {last.points, last.faces, last.wedges - 1}), FormatError);
}

/// Sum of squared distances of the points from where they should be, with every third part of positions lost.
double error_with(SplitFill fill, const SplitStreamHead& head, const Bytes& stream, const SplitMesh& whole,
                  bool again) {
  SplitStreamReader reader(head, {}, fill);
  std::size_t lost = 0;
  for (std::size_t i = 0; i < head.blocks.size(); ++i) {
    auto parts = parts_of(head, stream, i);
    if (i % 3 == 1 && !head.blocks[i].is_patch) {
      parts[1] = {};
      lost += head.blocks[i].count;
    }
    reader.add_parts(parts);
  }
  EXPECT_EQ(reader.lost_points().size(), lost);
  EXPECT_GT(lost, 0u);
  if (again) reader.refill_lost_points();
  EXPECT_EQ(face_wedges(reader.mesh()), face_wedges(whole));
  double sum = 0;
  for (std::size_t p = 0; p < whole.points().size(); ++p)
    for (std::size_t k = 0; k < 3; ++k)
      sum += std::pow(static_cast<double>(whole.points()[p][k]) - reader.mesh().points()[p][k], 2);
  return sum;
}

TEST(SplitStream, LostPositionsAreFoundByTheirTextureCoordinates) {
  const SplitFixture fixture = split_fixture(17);
  const Bytes stream = write_split_stream(fixture.source);
  const SplitStreamHead head = read_split_head(stream);
  ASSERT_EQ(head.attributes[0].kind, SplitKind::kUv0);
  SplitStreamReader whole(head, {}, SplitFill::kTexture);  // nothing is lost: nothing changes
  whole.read_to_scale(head.scales.size() - 1, stream);
  EXPECT_EQ(corners_of(whole.mesh()), fixture.scales.back());
  EXPECT_TRUE(whole.lost_points().empty());
  const double neighbours = error_with(SplitFill::kNeighbours, head, stream, whole.mesh(), false);
  const double texture = error_with(SplitFill::kTexture, head, stream, whole.mesh(), false);
  EXPECT_LT(texture, 0.8 * neighbours);
  EXPECT_LT(error_with(SplitFill::kTexture, head, stream, whole.mesh(), true), 0.8 * neighbours);
}

TEST(SplitStream, WithoutTextureCoordinatesLostPositionsAreTheNeighboursMean) {
  const SplitFixture fixture = split_fixture(17);
  const Bytes stream = write_split_stream(fixture.source);
  SplitStreamHead head = read_split_head(stream);
  for (SplitAttribute& a : head.attributes)
    if (a.kind == SplitKind::kUv0) a.kind = SplitKind::kUv1;
  SplitStreamReader whole(head);
  whole.read_to_scale(head.scales.size() - 1, stream);
  EXPECT_EQ(error_with(SplitFill::kTexture, head, stream, whole.mesh(), true),
            error_with(SplitFill::kNeighbours, head, stream, whole.mesh(), false));
}

/// Few bytes cannot ask for much work: connectivity that only ever says "not this point" ends.
TEST(SplitStream, EndlessRefusalsEnd) {
  const SplitFixture fixture = split_fixture(17);
  const Bytes stream = write_split_stream(fixture.source);
  SplitStreamHead head = read_split_head(stream);
  for (const std::uint8_t fill : {0x00, 0xff, 0x55}) {
    SplitStreamReader reader(head);
    reader.add_block(block_of(head, stream, 0));
    auto parts = parts_of(head, stream, 1);
    const Bytes bytes(parts[0].size(), fill);
    parts[0] = bytes;
    try {
      reader.add_parts(parts);
    } catch (const FormatError&) {
    }
    EXPECT_LE(reader.mesh().points().size(), head.scales.back().points);
  }
}

TEST(SplitStream, WriterRefusesSourcesThatContradictThemselves) {
  const SplitFixture good = split_fixture(5);
  const auto refuses = [&](const auto& change) {
    SplitSource source = good.source;
    change(source);
    EXPECT_THROW(write_split_stream(source), FormatError);
  };
  refuses([](SplitSource& s) { s.chapters.clear(); });
  refuses([](SplitSource& s) { s.chapters[0].patch.clear(); });
  refuses([](SplitSource& s) { s.position.bits = 25; });
  refuses([](SplitSource& s) { s.points[0][0] = -1; });
  refuses([](SplitSource& s) { s.values[0].pop_back(); });
  refuses([](SplitSource& s) { s.chapters.resize(101, s.chapters.back()); });
  refuses([](SplitSource& s) {
    std::swap(s.attributes[0], s.attributes[1]), std::swap(s.values[0], s.values[1]);
  });
  refuses([](SplitSource& s) { s.values[1][0] = 256; });
  refuses([](SplitSource& s) { s.face_group[0] = 3; });
  refuses([](SplitSource& s) { s.wedge_point[0] = 1000; });
  refuses([](SplitSource& s) { s.splits_per_block = 0; });
  refuses([](SplitSource& s) { s.chapters[0].patch[0].wedges[1] = s.chapters[0].patch[0].wedges[0]; });
  refuses([](SplitSource& s) { s.chapters[1].splits[0].parent = s.chapters[1].splits[0].child; });
  refuses([](SplitSource& s) { s.chapters[1].moves[0].face = s.chapters[1].born[0].face; });
  // Splits that wait for each other.
  refuses([](SplitSource& s) { s.chapters[1].before = {{0, 1}, {1, 0}}; });
}

TEST(SplitStream, GridValuesAreThoseOfTheFiles) {
  const SplitGrid grid{12, {-1, 2, 0.5f}, 3};
  EXPECT_EQ(grid.value(0, 0), -1.0f);
  EXPECT_EQ(grid.value(4095, 1), 4095.0f * grid.step() + 2.0f);
  EXPECT_EQ(grid.step(), 3.0f / 4095.0f);
}

TEST(SplitStream, OctahedralCodesAreTheNearest) {
  std::uint64_t state = 3;
  const auto random = [&state] {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<float>(static_cast<double>(state >> 33) / 1073741824.0 - 1);
  };
  for (const int bits : {4, 8, 10, 12}) {
    double worst = 1;
    for (int i = 0; i < 2000; ++i) {
      std::array<float, 3> n{random(), random(), random()};
      if (i % 7 == 0) n[static_cast<std::size_t>(i % 3)] = 0;
      const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      for (float& x : n) x /= length;
      const auto code = octahedral_code(n, bits);
      for (const std::int32_t c : code) ASSERT_TRUE(c >= 0 && c <= (1 << bits) - 2);
      const auto back = octahedral_normal(code[0], code[1], bits);
      worst = std::min(worst, static_cast<double>(n[0]) * back[0] + static_cast<double>(n[1]) * back[1] +
                                  static_cast<double>(n[2]) * back[2]);
    }
    EXPECT_GT(worst, std::cos(2.2 / (1 << (bits - 1)))) << bits;
  }
  EXPECT_EQ(octahedral_code({0, 0, 0}, 10), octahedral_code({0, 0, 1}, 10));
}

}  // namespace texmesh::split_stream_test
