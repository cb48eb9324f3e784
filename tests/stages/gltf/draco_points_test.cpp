#include "stages/gltf/draco_mesh.h"

#include <draco/mesh/mesh.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

namespace texmesh::draco_points_test {

template <class Element>
void add_attribute(draco::Mesh& mesh, int components, draco::DataType type,
                   const std::vector<Element>& values) {
  draco::GeometryAttribute attribute;
  attribute.Init(draco::GeometryAttribute::GENERIC, nullptr, static_cast<std::int8_t>(components), type,
                 false, sizeof(Element), 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(values.size()));
  for (std::uint32_t i = 0; i < values.size(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[i]);
}

/// `places` for each of the first two attributes: few make many points equal.
void fill(draco::Mesh& mesh, std::uint32_t points, std::uint32_t places, bool with_own) {
  std::mt19937 random(7);
  std::vector<std::array<float, 3>> positions;
  std::vector<std::array<std::uint8_t, 2>> small;
  std::vector<std::array<float, 2>> own;
  for (std::uint32_t i = 0; i < points; ++i) {
    // Draco tells 0 from -0, too.
    positions.push_back({static_cast<float>(random() % places), random() % 2 == 0 ? 0.0f : -0.0f, 1.0f});
    small.push_back({static_cast<std::uint8_t>(random() % places), 9});
    own.push_back({static_cast<float>(i), 0.0f});
  }
  mesh.set_num_points(points);
  add_attribute(mesh, 3, draco::DT_FLOAT32, positions);
  add_attribute(mesh, 2, draco::DT_UINT8, small);
  if (with_own) add_attribute(mesh, 2, draco::DT_FLOAT32, own);
  mesh.SetNumFaces(points);
  for (draco::FaceIndex f(0); f < points; ++f) {
    draco::Mesh::Face face;
    for (draco::PointIndex& p : face) p = draco::PointIndex(static_cast<std::uint32_t>(random() % points));
    mesh.SetFace(f, face);
  }
}

void expect_equal(const draco::Mesh& a, const draco::Mesh& b) {
  ASSERT_EQ(a.num_points(), b.num_points());
  ASSERT_EQ(a.num_faces(), b.num_faces());
  for (draco::FaceIndex f(0); f < a.num_faces(); ++f) EXPECT_EQ(a.face(f), b.face(f));
  for (int k = 0; k < a.num_attributes(); ++k) {
    const draco::PointAttribute &x = *a.attribute(k), &y = *b.attribute(k);
    ASSERT_EQ(x.size(), y.size());
    EXPECT_EQ(x.is_mapping_identity(), y.is_mapping_identity());
    for (draco::PointIndex p(0); p < a.num_points(); ++p) EXPECT_EQ(x.mapped_index(p), y.mapped_index(p));
    for (draco::AttributeValueIndex i(0); i < static_cast<std::uint32_t>(x.size()); ++i)
      EXPECT_EQ(0, std::memcmp(x.GetAddress(i), y.GetAddress(i), static_cast<std::size_t>(x.byte_stride())));
  }
}

void expect_as_draco(std::uint32_t points, std::uint32_t places, bool with_own) {
  draco::Mesh mesh, expected;
  fill(mesh, points, places, with_own);
  fill(expected, points, places, with_own);
  merge_equal_points(mesh);
  ASSERT_TRUE(expected.DeduplicateAttributeValues());
  expected.DeduplicatePointIds();
  expect_equal(mesh, expected);
  merge_equal_points(mesh);  // there is nothing left to merge
  expect_equal(mesh, expected);
}

TEST(DracoPoints, AreMergedAsDracoDoes) {
  expect_as_draco(500, 10, false);
  expect_as_draco(500, 1000, false);
  expect_as_draco(500, 10, true);
  expect_as_draco(500, 1, false);
}

TEST(DracoPoints, OfASmallMeshAreMergedToo) {
  expect_as_draco(1, 1, false);
  expect_as_draco(2, 1, false);
}

}  // namespace texmesh::draco_points_test
