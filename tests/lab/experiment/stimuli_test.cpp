#include "lab/experiment/make_experiment.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "format/base/vec.h"

namespace texmesh::stimuli_test {

Vec3d sides(const Mesh& mesh) {
  const auto s = bounding_box(mesh.positions).size();
  return {s.x, s.y, s.z};
}

/// Every edge of a closed surface belongs to two triangles, once in either direction.
bool is_closed(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  std::map<std::tuple<float, float, float>, std::uint32_t> places;
  std::vector<std::uint32_t> place;
  for (const Vec3f& p : mesh.positions)
    place.push_back(
        places.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(places.size())).first->second);
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{place[t[k]], place[t[(k + 1) % 3]]}];
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (count != 1 || back == edges.end() || back->second != 1) return false;
  }
  return true;
}

TEST(Stimuli, ShapesAreClosedAndTwoLong) {
  for (const StimulusKind kind : {StimulusKind::kEllipsoids, StimulusKind::kQuadrics})
    for (const StimulusShape& shape : draw_shapes(kind, 6, 5)) {
      const Mesh mesh = shape_mesh(shape, 0);
      EXPECT_TRUE(is_closed(mesh));
      const Vec3d s = sides(mesh);
      EXPECT_NEAR(std::max({s.x, s.y, s.z}), 2, 1e-5);
      ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
      ASSERT_EQ(mesh.colours.size(), mesh.positions.size());
      for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
        EXPECT_NEAR(length(to_double(mesh.normals[v])), 1, 1e-5);
        EXPECT_GT(dot(to_double(mesh.normals[v]), to_double(mesh.positions[v])), 0) << v;  // outwards
      }
    }
}

TEST(Stimuli, AChangeScalesTheAxesThatChange) {
  int exempt[4] = {};
  for (const StimulusShape& shape : draw_shapes(StimulusKind::kEllipsoids, 40, 5)) {
    const Vec3d before = sides(shape_mesh(shape, 0)), after = sides(shape_mesh(shape, 0.1));
    int changed = 0;
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(after[k] / before[k], 1 + 0.1 * shape.changes[k], 1e-4);
      changed += shape.changes[k] == 1;
    }
    ++exempt[3 - changed];
  }
  EXPECT_GT(exempt[0], 0);
  EXPECT_GT(exempt[1], 0);
  EXPECT_GT(exempt[2], 0);
  EXPECT_EQ(exempt[3], 0);
}

TEST(Stimuli, QuadricsAreIrregularAndChangeTheirDepth) {
  const StimulusShape shape = draw_shapes(StimulusKind::kQuadrics, 1, 5).front();
  const Mesh mesh = shape_mesh(shape, 0);
  double least = 10, most = 0;
  for (const Vec3f& p : mesh.positions) {
    const Vec3d unit{p.x / shape.axes.x, p.y / shape.axes.y, p.z / shape.axes.z};
    least = std::min(least, length(unit)), most = std::max(most, length(unit));
  }
  EXPECT_GT(most - least, 0.1);  // an ellipsoid has none
  const Vec3d before = sides(mesh), after = sides(shape_mesh(shape, -0.2));
  EXPECT_FLOAT_EQ(static_cast<float>(after.x), static_cast<float>(before.x));
  EXPECT_FLOAT_EQ(static_cast<float>(after.y), static_cast<float>(before.y));
  EXPECT_NEAR(after.z / before.z, 0.8, 1e-5);
}

TEST(Stimuli, ThePatternFollowsTheSurface) {
  const StimulusShape shape = draw_shapes(StimulusKind::kQuadrics, 1, 5).front();
  EXPECT_EQ(shape_mesh(shape, 0).colours, shape_mesh(shape, 0.2).colours);
}

TEST(Stimuli, EveryShapeFitsTheFrame) {
  ExperimentOptions options;
  options.levels = {0.05, 0.1, 0.27};
  options.objects = 5;
  const StimulusSet set = shape_stimuli(options);
  ASSERT_EQ(set.objects, 5u);
  std::set<int> signs;
  for (std::size_t object = 0; object < set.objects; ++object)
    for (std::size_t level = 0; level <= set.levels.size() + 1; ++level) {
      const Mesh mesh = set.shown(object, level).model.mesh;
      for (const Vec3f& p : mesh.positions) EXPECT_LE(length(to_double(p)), set.radius * 1.0001);
      if (level == 2) signs.insert(sides(mesh).z > sides(set.shown(object, 0).model.mesh).z ? 1 : -1);
    }
  EXPECT_EQ(signs.size(), 2u);  // some grow, some shrink
}

TEST(Stimuli, TheSeedDecides) {
  EXPECT_EQ(shape_mesh(draw_shapes(StimulusKind::kQuadrics, 2, 5)[1], 0),
            shape_mesh(draw_shapes(StimulusKind::kQuadrics, 3, 5)[1], 0));
  EXPECT_NE(shape_mesh(draw_shapes(StimulusKind::kQuadrics, 2, 5)[1], 0).positions,
            shape_mesh(draw_shapes(StimulusKind::kQuadrics, 2, 6)[1], 0).positions);
}

}  // namespace texmesh::stimuli_test
