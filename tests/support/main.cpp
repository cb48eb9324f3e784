// The program of a room's tests: `stages_ssf_tests` runs all, `stages_ssf_tests stages/ssf/ssf_test.cpp`
// those of one source. These are reported under the name that ctest has for the source. GoogleTest's options
// hold, too.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace {

/** A filter for the tests of a source, whose path begins in tests/; empty when it has none. */
std::string tests_of(const std::string& source) {
  std::string filter;
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int s = 0; s < all.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *all.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const testing::TestInfo& test = *suite.GetTestInfo(t);
      if (std::string(test.file()).ends_with("tests/" + source))
        filter += std::string(suite.name()) + "." + test.name() + ":";
    }
  }
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string source = argc > 1 && argv[argc - 1][0] != '-' ? argv[argc - 1] : "";
  if (std::string report = GTEST_FLAG_GET(output); !source.empty() && report.ends_with('/')) {
    std::string name = source.substr(0, source.rfind('.'));
    std::replace(name.begin(), name.end(), '/', '_');
    GTEST_FLAG_SET(output, report + name + ".xml");
  }
  testing::InitGoogleTest(&argc, argv);
  if (!source.empty()) {
    const std::string filter = tests_of(source);
    if (filter.empty()) {
      std::fprintf(stderr, "no test of this program is in tests/%s\n", source.c_str());
      return 2;
    }
    if (GTEST_FLAG_GET(filter) == "*") GTEST_FLAG_SET(filter, filter);
  }
  return RUN_ALL_TESTS();
}
