#include "pipeline/import/import.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/meshes.h"

namespace texmesh::import_model_test {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;
using testing::MemoryResolver;

TEST(ImportModel, ContentDecidesThenTheName) {
  MemoryResolver resolver;
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_EQ(import_model("wrong.obj", bytes_of(ply), resolver, {}, {}).format, "ply");
  EXPECT_EQ(import_model("A.OBJ", bytes_of("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), resolver, {}, {}).format,
            "obj");
  EXPECT_THROW(import_model("a.obj", {}, resolver, {}, {}), InputError);
  EXPECT_THROW(import_model("a.fbx", bytes_of("Kaydara FBX Binary"), resolver, {}, {}), InputError);
  EXPECT_THROW(import_model("noname", bytes_of("?"), resolver, {}, {}), InputError);
  ImportOptions options;
  options.max_file_bytes = 10;
  EXPECT_THROW(import_model("a.ply", bytes_of(ply), resolver, options, {}), InputError);
}

TEST(ImportModel, WhatTheSourceSaysOfItself) {
  MemoryResolver resolver;
  const std::string shape = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const auto imported = [&](const std::string& name, const std::string& text, UpAxis up = UpAxis::kKeep) {
    ImportOptions options;
    options.up = up;
    return import_model(name, bytes_of(text), resolver, options, {});
  };
  const ImportedModel obj =
      imported("a.obj", "# Author: A. Smith\n# unit: mm\n# up: z\n# licence: ask\n" + shape);
  EXPECT_EQ(obj.about.creator, "A. Smith");
  EXPECT_EQ(obj.about.metres_per_unit, 0.001);
  EXPECT_EQ(obj.about.up_axis, "z");
  EXPECT_EQ(count_notes(obj.model, "unknown-licence"), 1);
  EXPECT_EQ(imported("a.obj", "# up: z\n" + shape, UpAxis::kZ).about.up_axis, "y") << "the model was turned";
  const ImportedModel turned = imported("a.obj", "# up: z\n" + shape, UpAxis::kAuto);
  EXPECT_EQ(turned.about.up_axis, "y");
  EXPECT_EQ(count_notes(turned.model, kTurnedNote), 1);
  EXPECT_EQ(turned.about.source,
            R"({"format":"obj","comments":["up: z"],"turned":{"up":"z","by":"the source's word"}})");
  EXPECT_EQ(turned.model.mesh.positions, imported("a.obj", shape, UpAxis::kZ).model.mesh.positions);
  EXPECT_EQ(imported("a.obj", "# up: y\n" + shape, UpAxis::kAuto).model.mesh.positions,
            imported("a.obj", shape).model.mesh.positions);
  EXPECT_EQ(imported("a.obj", shape, UpAxis::kY).about.up_axis, "y") << "the user says so";
  const About silent = imported("a.obj", shape).about;
  EXPECT_EQ(silent.source, R"({"format":"obj"})");
  EXPECT_EQ(silent.metres_per_unit, 0) << "nobody has said";
  EXPECT_EQ(silent.up_axis, "");
  const std::string terrain =
      "ply\nformat ascii 1.0\ncomment licence: CC-BY-4.0\nobj_info crs: EPSG:25832\ncomment unit: cubit\n"
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  const ImportedModel ply = imported("a.ply", terrain);
  const ImportedModel upright = imported("a.ply", terrain, UpAxis::kAuto);
  EXPECT_EQ(upright.model.mesh.positions, imported("a.ply", terrain, UpAxis::kZ).model.mesh.positions)
      << "eastings and northings leave z for heights";
  EXPECT_EQ(count_notes(upright.model, kTurnedNote), 1);
  EXPECT_EQ(ply.about.licence, "CC-BY-4.0");
  EXPECT_EQ(ply.about.epsg, 25832u);
  EXPECT_EQ(count_notes(ply.model, "about-value"), 1);
  const ImportedModel stl = imported("a.stl",
                                     "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                     "vertex 0 1 0\nendloop\nendfacet\nendsolid\n");
  EXPECT_EQ(stl.about.source, R"({"format":"stl"})");
}

TEST(ImportModel, AGltfKeepsItsExtrasAndItsCopyright) {
  MemoryResolver resolver;
  const std::string positions = "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
  const std::string gltf =
      R"({"asset":{"version":"2.0","copyright":"A. Smith","extras":{"license":"CC0-1.0"}},
    "scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"extras":{"find":17}}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":")" +
      positions + "\"}]}";
  const About about = import_model("a.gltf", bytes_of(gltf), resolver, {}, {}).about;
  EXPECT_EQ(about.attribution, "A. Smith");
  EXPECT_EQ(about.licence, "CC0-1.0");
  EXPECT_EQ(about.metres_per_unit, 1);
  EXPECT_EQ(about.up_axis, "y");
  EXPECT_NE(about.source.find(R"({"path":"/nodes/0","value":{"find":17}})"), std::string::npos)
      << about.source;
}

}  // namespace texmesh::import_model_test
