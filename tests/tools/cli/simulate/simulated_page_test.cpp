// What simulate says of several objects, and of packets that are lost.
#include "tools/cli/simulate/simulated_page.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/format/container/package_fixture.h"
#include "tests/support/command.h"
#include "tests/support/schema.h"
#include "tools/cli/options/units.h"
#include "tools/cli/simulate/lost_packets.h"

namespace texmesh {
namespace {

TEST(SimulatedPage, APackageMayHaveItsOwnHeight) {
  EXPECT_EQ(beside_object("vase.texmesh").package, "vase.texmesh");
  EXPECT_EQ(beside_object("vase.texmesh").displayed_px, 0);
  EXPECT_EQ(beside_object("a,b.texmesh,200").package, "a,b.texmesh");
  EXPECT_EQ(beside_object("a,b.texmesh,200").displayed_px, 200);
  EXPECT_EQ(beside_object("a,b.texmesh").package, "a,b.texmesh");
  EXPECT_THROW(beside_object("a.texmesh,0"), UsageError);
  EXPECT_THROW(beside_object("a.texmesh,1e9"), UsageError);
}

TEST(SimulatedPage, JsonFollowsItsSchema) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "a.texmesh";
  const std::vector<std::uint8_t> package = testing::make_package(1, 20'000);
  testing::write_text(path, std::string(package.begin(), package.end()));
  DeliveryRequest r;
  r.displayed_px = 400;
  r.network.link = BandwidthTrace::constant(1e6);
  const nlohmann::json j = nlohmann::json::parse(simulated_page(path, {path + ",200"}, r, true));
  EXPECT_TRUE(testing::follows_schema(j, "simulate.v1"));
  EXPECT_EQ(j["objects"].size(), 2u);
  EXPECT_EQ(j["objects"][1]["display_px"], 200);
  EXPECT_NE(simulated_page(path, {path}, r, false).find("by itself"), std::string::npos);
}

TEST(LostPackets, TableFollowsItsSchemaAndAProxyHasNone) {
  LostPacketsTable table{100, 9, {{0.05, 3, 2, 0.7, 0.2, 0.4, 0.03}}};
  EXPECT_TRUE(testing::follows_schema(nlohmann::json::parse(lost_packets_json(table)), "simulate.v1"));
  EXPECT_NE(lost_packets_text(table).find("HTTP loses none"), std::string::npos);
  EXPECT_EQ(lost_packets_csv(table).substr(0, 5), "loss,");
  PackageReader package(open_container(memory_source(testing::make_package(1, 20'000))));
  DeliveryPlan plan;
  plan.proxy = 0;
  EXPECT_THROW(lost_packets(package, plan, {}, {}, 0.1, 1), InputError);
}

}  // namespace
}  // namespace texmesh
