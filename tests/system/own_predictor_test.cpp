// A predictor that this file alone knows: named in options, packed, read, and followed by a plan.
#include <gtest/gtest.h>

#include "delivery/cpp/client/delivery_plan.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/memory_store.h"
#include "pipeline/graph/store.h"
#include "tests/support/command.h"
#include "tests/support/images.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"

namespace texmesh {
namespace {

double left_edge(const FragmentReader& reader, std::size_t fragment) {
  return fragment_rectangle(reader.plane(), fragment).left_px;
}

const NamedPredictor kEast("east", left_edge);
const NamedPredictor kWest("west", [](const FragmentReader& r, std::size_t f) { return -left_edge(r, f); });
const NamedPredictor kCovered("covered", [](const FragmentReader& reader, std::size_t f) {
  return static_cast<double>(reader.read(f).count);
});
const NamedPredictor kBroken("broken", [](const FragmentReader&, std::size_t) { return std::nan(""); });

/// A sheet with a texture of 4 x 2 fragments, and the cheapest options of the thesis's allocation.
class OwnPredictor : public ::testing::Test {
 protected:
  OwnPredictor() {
    const Bytes glb = testing::make_glb(testing::sheet(12), testing::jpeg_bytes(512, 256, 3)).glb();
    testing::write_text(folder_ / "sheet.glb", std::string(glb.begin(), glb.end()));
    options_.ssf.scales = 2;
    options_.quality = {1, 32, 1};
    options_.proxies.mode = ProxyMode::kNone;
    options_.fragmentation.min_fragment_px = 128;
    options_.ladder.rungs = {10, 40, 70, 95};
    options_.ladder.prune = false;
    options_.lut.allocate = Allocation::kVqp;
    options_.zim.weight_eta = options_.zim.weight_z = options_.zim.weight_i = options_.zim.weight_m = 0;
  }
  PackageReader compile(const std::string& weights) {
    options_.zim.weights = weights;
    CompileRequest request;
    request.input = folder_ / "sheet.glb";
    request.output = folder_ / "sheet.texmesh";
    request.options = options_;
    compile_model(request, store_, {}, {});
    return PackageReader(open_store(request.output));
  }
  /// What is wrong with the options, at the place that an error names.
  std::string refused(const std::string& weights) {
    options_.zim.weights = weights;
    try {
      check_options(options_, "profile.json");
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  testing::TemporaryFolder folder_;
  MemoryStore store_;
  CompileOptions options_;
};

TEST_F(OwnPredictor, IsPackedAndAPlanFollowsIt) {
  for (const std::string name : {"east", "west"}) {
    PackageReader package = compile(name + "=3");
    const PlaneThesis* thesis = package.plane_thesis(0);
    const PlaneTables& tables = package.tables().planes[0];
    ASSERT_NE(thesis, nullptr);
    ASSERT_GT(tables.columns, 1u);
    for (std::size_t f = 0; f < tables.fragment_count(); ++f) {
      const double at = static_cast<double>(f % tables.columns) / (tables.columns - 1);
      EXPECT_NEAR(thesis->vqp[f], name == "east" ? at : 1 - at, 1e-4) << name << " " << f;
    }
    double west = 0, east = 0;  // rungs of the outermost columns
    for (const double bytes_s : {1e4, 3e4, 1e5}) {
      DeliveryRequest request = as_printed({});
      request.network.link = BandwidthTrace::constant(bytes_s);
      const DeliveryPlan plan = plan_delivery(package, request);
      const FragmentList list = list_of(package, request, plan);
      for (std::size_t k = 0; k < list.fragments.size(); ++k) {
        if (list.fragments[k].plane != 0) continue;
        const std::size_t column = list.fragments[k].fragment % tables.columns;
        if (column == 0) west += plan.textures.rungs[k];
        if (column == tables.columns - 1) east += plan.textures.rungs[k];
      }
    }
    EXPECT_TRUE(name == "east" ? east > west : west > east) << name << ": " << west << ", " << east;
  }
}

TEST_F(OwnPredictor, JoinsTheOthersByItsWeight) {
  options_.zim.weight_i = 1;
  const std::vector<float> light = compile("").plane_thesis(0)->vqp;
  const std::vector<float> both = compile("east=3").plane_thesis(0)->vqp;
  const std::size_t columns = 4;
  ASSERT_EQ(light.size(), 8u);
  for (std::size_t f = 0; f < light.size(); ++f)
    EXPECT_NEAR(both[f], (light[f] + static_cast<float>(f % columns)) / 4, 1e-4) << f;
}

TEST_F(OwnPredictor, ProvenanceNamesItAndIsAsBeforeWithoutOne) {
  const auto options = [](PackageReader package) {
    const Bytes text = package.entry(package.manifest().provenance);
    return std::string(text.begin(), text.end());
  };
  EXPECT_NE(options(compile("covered=1,east=2")).find("\"weights\":\"covered=1,east=2\""), std::string::npos);
  options_.zim.weight_z = 1;
  EXPECT_EQ(options(compile("")).find("\"weights\""), std::string::npos);
}

TEST_F(OwnPredictor, TextsThatAreNoListOfKnownOnesAreRefused) {
  EXPECT_EQ(refused("east=0.5,west=100"), "");
  for (const char* text : {"north=1", "east", "east=", "east=-1", "east=101", "east=nan", "east=1x", "=1",
                           ",", "east=1,", "east=1,east=2", "east = 1", "east=0x1"})
    EXPECT_NE(refused(text).find("zim.weights: expected NAME=WEIGHT"), std::string::npos) << text;
  EXPECT_NE(refused("north=1").find("broken, covered, east, west"), std::string::npos) << "what is known";
  EXPECT_NE(refused("").find("zim.weight_eta"), std::string::npos) << "no weight at all";
  EXPECT_NE(refused("east=0").find("zim.weight_eta"), std::string::npos);
  EXPECT_THROW(compile("broken=1"), StageError);
  for (const char* name : {"", "East", "east", "a b", "a=b", "a,b"})
    EXPECT_THROW(NamedPredictor(name, left_edge), std::logic_error) << name;
}

}  // namespace
}  // namespace texmesh
