#include "tools/publish/pages/built_in_file.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace texmesh {
namespace {

TEST(Filled, PutsValuesIntoTheirPlaces) {
  EXPECT_EQ(filled("a {{x}} b {{y}}{{x}}", {{"x", "1"}, {"y", "2"}}), "a 1 b 21");
  EXPECT_EQ(filled("nothing } to { do", {}), "nothing } to { do");
}

TEST(Filled, NeverLooksIntoAValue) { EXPECT_EQ(filled("{{x}}", {{"x", "{{y}}{{x}}"}}), "{{y}}{{x}}"); }

TEST(Filled, ANameWithoutAValueIsAMistakeOfOurs) { EXPECT_THROW(filled("{{z}}", {}), std::logic_error); }

}  // namespace
}  // namespace texmesh
