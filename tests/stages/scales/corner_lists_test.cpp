#include "stages/scales/vertex_split.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include <numeric>

#include "tests/support/meshes.h"

namespace texmesh::corner_lists_test {

/// A fan of faces (0, i + 1, i + 2) around the point 0.
std::vector<ReplayFace> fan(std::uint32_t faces) {
  std::vector<ReplayFace> out(faces);
  for (std::uint32_t f = 0; f < faces; ++f) out[f].point = {0, f + 1, f + 2};
  return out;
}
std::vector<std::uint32_t> alive_at(const CornerLists& lists, const std::vector<ReplayFace>& faces,
                                    std::uint32_t point) {
  std::vector<std::uint32_t> out;
  for (const std::uint32_t c : lists.at(point))
    if (faces[c / 3].alive) out.push_back(c);
  return out;
}

TEST(CornerLists, HoldTheCornersOfFacesThatAreAliveInTheirOrder) {
  std::vector<ReplayFace> faces = fan(3);
  faces[1].alive = false;
  const CornerLists lists(faces, 5);
  EXPECT_EQ(alive_at(lists, faces, 0), (std::vector<std::uint32_t>{0, 6}));
  EXPECT_EQ(alive_at(lists, faces, 2), (std::vector<std::uint32_t>{2}));
  EXPECT_EQ(alive_at(lists, faces, 3), (std::vector<std::uint32_t>{7}));
}

TEST(CornerLists, GiveUpDeadFacesBeforeTheyTakeMoreRoom) {
  std::vector<ReplayFace> faces = fan(8);
  CornerLists lists(faces, 10);
  const std::uint32_t* const before = lists.at(0).data();
  for (std::uint32_t f = 0; f < 4; ++f) faces[f].alive = false;
  for (std::uint32_t f = 4; f < 8; ++f) lists.add(0, 3 * f);
  EXPECT_EQ(lists.at(0).data(), before);
  EXPECT_EQ(lists.at(0).size(), 8u);
  lists.add(0, 12);  // none is dead: the list moves
  EXPECT_NE(lists.at(0).data(), before);
  EXPECT_EQ(lists.at(0).size(), 9u);
}

TEST(CornerLists, AreThoseOfPlainListsWhateverIsAddedAndDies) {
  constexpr std::uint32_t kFaces = 300;
  std::vector<ReplayFace> faces = fan(kFaces);
  CornerLists lists(faces, kFaces + 2);
  std::vector<std::vector<std::uint32_t>> plain(kFaces + 2);
  for (std::uint32_t f = 0; f < kFaces; ++f)
    for (std::uint32_t k = 0; k < 3; ++k) plain[faces[f].point[k]].push_back(3 * f + k);
  testing::Random random{3};
  for (int step = 0; step < 4000; ++step) {
    const auto point = static_cast<std::uint32_t>(random.uniform() * 8);
    const auto face = static_cast<std::uint32_t>(random.uniform() * kFaces);
    if (step % 40 == 0) {
      faces[face].alive = false;
    } else if (step % 97 == 0) {
      lists.clear(point);
      plain[point].clear();
    } else {
      lists.add(point, 3 * face);
      plain[point].push_back(3 * face);
    }
  }
  for (std::uint32_t p = 0; p < plain.size(); ++p) {
    std::erase_if(plain[p], [&](std::uint32_t c) { return !faces[c / 3].alive; });
    EXPECT_EQ(alive_at(lists, faces, p), plain[p]) << p;
  }
}

}  // namespace texmesh::corner_lists_test
