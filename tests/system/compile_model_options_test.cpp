// Options on their way into a package: provenance says what was used, whoever chose it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/memory_store.h"
#include "pipeline/graph/store.h"
#include "tests/support/command.h"
#include "tools/inspect/provenance.h"

namespace texmesh::compile_model_options_test {

/// A tent of two triangles in an OBJ file, and the cheapest options.
class CompiledOptions : public ::testing::Test {
 protected:
  CompiledOptions() {
    testing::write_text(folder_ / "tent.obj", "v 0 0 0\nv 2 0 0\nv 2 2 1\nv 0 2 1\nf 1 2 3\nf 1 3 4\n");
    options_.ssf.scales = 2;
    options_.quality = {1, 32, 1};
  }
  /// What provenance holds of an option.
  std::string recorded(const std::string& stage, const std::string& name) {
    CompileRequest request;
    request.input = folder_ / "tent.obj";
    request.output = folder_ / "tent.texmesh";
    request.options = options_;
    compile_model(request, store_, {}, {});
    PackageReader package(open_store(request.output));
    return read_provenance(package.entry(package.manifest().provenance)).options->at(stage).at(name).dump();
  }
  testing::TemporaryFolder folder_;
  MemoryStore store_;
  CompileOptions options_;
};

TEST_F(CompiledOptions, ProvenanceHoldsTheResolvedValueAndTheUsersOwn) {
  EXPECT_EQ(recorded("fragmentation", "min_fragment_px"), "128");
  options_.ladder.mode = LadderMode::kProgressive;
  EXPECT_EQ(recorded("fragmentation", "min_fragment_px"), "256");
  options_.set_by_user.insert("fragmentation.min_fragment_px");
  EXPECT_EQ(recorded("fragmentation", "min_fragment_px"), "128");
  options_.fragmentation.fill = Fill::kNone;
  EXPECT_EQ(recorded("ladder", "uncovered"), "\"kept\"");
}

}  // namespace texmesh::compile_model_options_test
