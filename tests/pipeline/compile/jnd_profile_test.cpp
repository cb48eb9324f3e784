// What is valid and what is not is tested with the schema's examples (schemas_test).
#include "pipeline/compile/options.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh::jnd_profile_test {

void read(CompileOptions& options, const std::string& json) {
  read_jnd_profile(options, {reinterpret_cast<const std::uint8_t*>(json.data()), json.size()}, "jnd.json");
}

TEST(JndProfile, BecomesOptions) {
  CompileOptions options;
  read(options, R"({"version":1,"title":"t","jnd":0.05,"reference_px":800,"statistic":"conservative"})");
  EXPECT_EQ(options.perceptual_values.jnd, 0.05);
  EXPECT_EQ(options.perceptual_values.jnd_reference_px, 800);
  EXPECT_EQ(options.perceptual_values.statistic, PerceptualStatistic::kConservative);
}

TEST(JndProfile, AbsentFieldsKeepTheirValues) {
  CompileOptions options;
  options.perceptual_values.statistic = PerceptualStatistic::kAverage;
  read(options, R"({"version":1,"jnd":0.2})");
  EXPECT_EQ(options.perceptual_values.statistic, PerceptualStatistic::kAverage);
  EXPECT_EQ(options.perceptual_values.jnd_reference_px, kJndReferencePx);
}

TEST(JndProfile, HoldsAtEveryDistanceUnlessItSaysOtherwise) {
  CompileOptions options;
  EXPECT_EQ(options.perceptual_values.jnd_distance_exponent, 1);
  read(options, R"({"version":1,"jnd":0.2})");
  EXPECT_EQ(options.perceptual_values.jnd_distance_exponent, 0);
  read(options, R"({"version":1,"jnd":0.2,"distance_exponent":0.75})");
  EXPECT_EQ(options.perceptual_values.jnd_distance_exponent, 0.75);
}

TEST(JndProfile, ErrorsNameThePlaceAndChangeNothing) {
  const auto place = [](const std::string& json) -> std::string {
    CompileOptions options;
    try {
      read(options, json);
    } catch (const InputError& e) {
      EXPECT_EQ(e.file(), "jnd.json");
      EXPECT_EQ(options.perceptual_values.jnd, 0.1);
      return e.place();
    }
    return "none";
  };
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"reference_px":0})"), "/reference_px");
  EXPECT_EQ(place(R"({"version":1,"jnd":2})"), "/jnd");
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"statistic":5})"), "/statistic");
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"distance_exponent":2.1})"), "/distance_exponent");
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"distance_exponent":-1})"), "/distance_exponent");
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"x":1})"), "/x");
  EXPECT_EQ(place(R"({"version":1,"jnd":0.3,"title":[1]})"), "/title");
  EXPECT_NE(place("{"), "none");
  EXPECT_NE(place(std::string(70000, ' ')), "none");
  EXPECT_NE(place(std::string(5000, '[')), "none");
}

}  // namespace texmesh::jnd_profile_test
