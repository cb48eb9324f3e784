#include "tools/cli/check/check_gate.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/packages.h"

namespace texmesh::testing::check_gate_test {

std::size_t failures(const std::vector<GateResult>& results) {
  return static_cast<std::size_t>(
      std::ranges::count_if(results, [](const GateResult& r) { return !r.failure.empty(); }));
}

TEST(CheckGate, EveryLimitOfAPlanIsACase) {
  DeliveryPlan plan;
  plan.flip = 0.2, plan.texture_flip = 0.1;
  plan.first_picture_s = 1, plan.complete_s = 3, plan.texture_bytes = 5000;
  EXPECT_EQ(check_plan(plan, {}, 3).size(), 5u);
  EXPECT_EQ(failures(check_plan(plan, {}, 3)), 0u);
  EXPECT_EQ(failures(check_plan(plan, {0.19, 0.09, 0.9, 4999}, 2)), 5u);
  plan.flip = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(failures(check_plan(plan, {}, 3)), 1u);
}

TEST(CheckGate, SwitchSizesAreRendered) {
  const Bytes package = make_package_parts().build();
  PackageReader reader(open_container(memory_source(package)));
  const std::vector<GateResult> strict = check_switch_sizes(reader, 0, 2, {});
  ASSERT_EQ(strict.size(), 1u);
  EXPECT_EQ(strict[0].failure.find("S_5 at 200 px: measured FLIP"), 0u) << strict[0].failure;
  EXPECT_EQ(failures(check_switch_sizes(reader, 1, 2, {})), 0u);
}

TEST(CheckGate, JunitHasACaseForEach) {
  const std::string xml = gate_junit("texmesh check", "a<b>\"&.texmesh", {{"one", ""}, {"two", "3 < 4"}});
  EXPECT_NE(xml.find("tests=\"2\" failures=\"1\""), std::string::npos) << xml;
  EXPECT_NE(xml.find("classname=\"a&lt;b&gt;&quot;&amp;.texmesh\" name=\"one\"/>"), std::string::npos) << xml;
  EXPECT_NE(xml.find("<failure message=\"3 &lt; 4\"/>"), std::string::npos) << xml;
}

}  // namespace texmesh::testing::check_gate_test
