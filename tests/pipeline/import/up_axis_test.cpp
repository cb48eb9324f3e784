#include "pipeline/import/up_axis.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::up_axis_test {

struct Ring {
  float height, radius;
};

/// A body of revolution about z with its corners in order of height; `bottom` and `top` close it. Every
/// triangle has points of its own, as in STL.
Mesh turned_body(const std::vector<Ring>& rings, bool bottom, bool top) {
  constexpr std::uint32_t kSides = 24;
  Mesh mesh;
  const auto at = [&](std::size_t ring, std::uint32_t side) {
    const double angle = 2 * M_PI * (side % kSides) / kSides;
    return Vec3f{static_cast<float>(rings[ring].radius * std::cos(angle)),
                 static_cast<float>(rings[ring].radius * std::sin(angle)), rings[ring].height};
  };
  const auto add = [&](Vec3f a, Vec3f b, Vec3f c) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec3f p : {a, b, c}) {
      mesh.wedge_position.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(p);
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  };
  for (std::uint32_t s = 0; s < kSides; ++s) {
    for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
      add(at(r, s), at(r, s + 1), at(r + 1, s + 1));
      add(at(r, s), at(r + 1, s + 1), at(r + 1, s));
    }
    const std::size_t last = rings.size() - 1;
    if (bottom) add({0, 0, rings[0].height}, at(0, s + 1), at(0, s));
    if (top) add({0, 0, rings[last].height}, at(last, s), at(last, s + 1));
  }
  return mesh;
}

const std::vector<Ring> kBottle{{0, 1}, {2, 1}, {3, .3F}, {4, .25F}},
    kDome{{0, 1}, {.5F, .87F}, {.87F, .5F}, {1, 0}}, kVase{{0, .5F}, {1, 1}, {2, .6F}, {2.2F, .2F}};

Mesh on_axis(Mesh mesh, char up) {  // of one that stands on z
  for (Vec3f& p : mesh.positions)
    if (up == 'y')
      p = {p.x, p.z, -p.y};
    else if (up == 'x')
      p = {p.z, p.y, -p.x};
  return mesh;
}

Mesh upside_down(Mesh mesh) {
  for (Vec3f& p : mesh.positions) p = {p.x, -p.y, -p.z};
  return mesh;
}

TEST(GuessedUp, AnObjectStandsOnItsBottom) {
  for (const auto& rings : {kBottle, kDome, kVase}) {
    const Mesh closed = turned_body(rings, true, rings.back().radius > 0);
    EXPECT_EQ(guessed_up(closed), 'z');
    EXPECT_EQ(guessed_up(on_axis(closed, 'y')), 'y');
    EXPECT_EQ(guessed_up(on_axis(closed, 'x')), '\0') << "no program has x up";
    EXPECT_EQ(guessed_up(upside_down(closed)), '\0');
  }
}

TEST(GuessedUp, AScanWithoutABottomStandsOnTheRimOfItsOpening) {
  const Mesh open = turned_body(kDome, false, false);
  EXPECT_EQ(guessed_up(open), 'z');
  EXPECT_EQ(guessed_up(on_axis(open, 'y')), 'y');
  EXPECT_EQ(guessed_up(upside_down(open)), '\0') << "a bowl has no bottom at its low end";
}

TEST(GuessedUp, SizeAndPlaceDoNotCount) {
  for (const float scale : {1e-3F, 1e4F}) {
    Mesh mesh = turned_body(kBottle, true, true);
    for (Vec3f& p : mesh.positions) p = p * scale + Vec3f{7 * scale, -3 * scale, 11 * scale};
    EXPECT_EQ(guessed_up(mesh), 'z') << scale;
  }
}

TEST(GuessedUp, WhatCouldStandOtherwiseTellsNothing) {
  EXPECT_EQ(guessed_up({}), '\0');
  EXPECT_EQ(guessed_up(turned_body({{0, 1}, {2, 1}}, true, true)), '\0') << "two equal ends";
  EXPECT_EQ(guessed_up(turned_body({{0, 0}, {1, 1}, {2, 0}}, false, false)), '\0') << "no end";
  EXPECT_EQ(guessed_up(turned_body({{0, 1}, {.1F, .8F}}, true, true)), '\0') << "a relief, or a floor";
  EXPECT_EQ(guessed_up(turned_body({{0, .5F}, {1, .6F}, {4, 2}}, true, false)), '\0') << "most of it is high";
  Mesh point = turned_body(kBottle, true, true);
  for (Vec3f& p : point.positions) p = {1, 2, 3};
  EXPECT_EQ(guessed_up(point), '\0');
}

TEST(TurnUp, StandsUprightAfterIt) {
  for (const char up : {'x', 'z'}) {
    Mesh mesh = on_axis(turned_body(kBottle, true, true), up);
    mesh.origin = up == 'x' ? Vec3d{5, 1, 2} : Vec3d{1, 2, 5};
    turn_up(mesh, up);
    EXPECT_EQ(guessed_up(mesh), 'y') << up;
    EXPECT_EQ(mesh.origin.y, 5) << up;
  }
  Mesh kept = turned_body(kBottle, true, true);
  const std::vector<Vec3f> before = kept.positions;
  turn_up(kept, 'y');
  EXPECT_EQ(kept.positions, before);
}

TEST(TurnedAxis, IsTheUsersOrTheOneThatImportTells) {
  About about;
  EXPECT_EQ(turned_axis(about, UpAxis::kAuto), 'y');
  EXPECT_EQ(turned_axis(about, UpAxis::kZ), 'z');
  about.source = R"({"format":"obj","turned":{"up":"x","by":"a guess"}})";
  EXPECT_EQ(turned_axis(about, UpAxis::kAuto), 'x');
  EXPECT_EQ(turned_axis(about, UpAxis::kKeep), 'y');
  for (const char* other :
       {R"({"turned":{"up":"w"}})", R"({"turned":{"up":""}})", R"({"turned":{}})", "[]", "{"}) {
    about.source = other;
    EXPECT_EQ(turned_axis(about, UpAxis::kAuto), 'y') << other;
  }
  EXPECT_EQ(turned_up(Vec3d{1, 2, 3}, 'z'), (Vec3d{1, 3, -2}));
  EXPECT_EQ(turned_up(Vec3d{1, 2, 3}, 'x'), (Vec3d{-2, 1, 3}));
  EXPECT_EQ(turned_up(Vec3d{1, 2, 3}, 'y'), (Vec3d{1, 2, 3}));
}

}  // namespace texmesh::up_axis_test
