#include "pipeline/import/import.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

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

}  // namespace
}  // namespace texmesh
