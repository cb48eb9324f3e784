// Models that are too large for the memory, and stores that keep nothing.
#include <gtest/gtest.h>

#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/memory_store.h"
#include "pipeline/graph/store.h"
#include "pipeline/io/resolver.h"
#include "tests/support/command.h"

namespace texmesh::compile_model_memory_test {

/// A tent of two triangles in an OBJ file, and the cheapest options.
class ModelMemory : public ::testing::Test {
 protected:
  ModelMemory() {
    testing::write_text(folder_ / "tent.obj", "v 0 0 0\nv 2 0 0\nv 2 2 1\nv 0 2 1\nf 1 2 3\nf 1 3 4\n");
    request_.input = folder_ / "tent.obj";
    request_.output = folder_ / "tent.texmesh";
    request_.options.ssf.scales = 2;
    request_.options.quality = {1, 32, 1};
  }
  std::string compiled(Store& store) {
    compile_model(request_, store, {}, {});
    return testing::read_text(request_.output);
  }
  testing::TemporaryFolder folder_;
  CompileRequest request_;
};

TEST_F(ModelMemory, WhatSurelyNeedsMoreIsRefusedBeforeWorkBegins) {
  NullStore store;
  request_.memory_bytes = least_memory_bytes(2) - 1;
  bool stage_began = false;
  try {
    compile_model(request_, store, {}, [&](auto&&...) { stage_began = true; });
    FAIL() << "no error";
  } catch (const ResourceError& e) {
    EXPECT_EQ(e.file(), "tent.obj");
    EXPECT_NE(e.expected().find("--model-memory"), std::string::npos) << e.what();
    EXPECT_NE(e.found().find("2 triangles, which take "), std::string::npos) << e.what();
  }
  EXPECT_FALSE(stage_began);
  EXPECT_EQ(testing::files_beneath(folder_.path().string()), std::vector<std::string>{"tent.obj"});
  request_.memory_bytes = least_memory_bytes(2);
  EXPECT_FALSE(compiled(store).empty());
}

TEST_F(ModelMemory, AStoreThatKeepsNothingChangesNoByte) {
  NullStore none;
  MemoryStore all;
  const std::string package = compiled(none);
  EXPECT_EQ(package, compiled(all));
  EXPECT_EQ(package, compiled(all));
}

}  // namespace texmesh::compile_model_memory_test
