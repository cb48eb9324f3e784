// Dependency files that GNU make and Ninja read alike.
#include "pipeline/batch/run.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tests/support/command.h"

namespace texmesh::depfile_test {

TEST(Depfile, EscapesWhatBothKnow) {
  EXPECT_EQ(write_depfile("o.texmesh", {"a b#c:d$e.obj"}),
            "o.texmesh: \\\n  a\\ b\\#c\\:d$$e.obj\n\na\\ b\\#c\\:d$$e.obj:\n");
}

TEST(Depfile, RefusesWhatOneOfThemTakesForSomethingElse) {
  for (const char c : std::string(";|=%*?'&\t\n\r")) {
    EXPECT_THROW(write_depfile("o.texmesh", {std::string("a") + c + "b"}), InputError) << c;
    EXPECT_THROW(write_depfile(std::string("o") + c, {"a"}), InputError) << c;
  }
  EXPECT_THROW(write_depfile("o", {"a\\ b"}), InputError);
  EXPECT_NO_THROW(write_depfile("o", {"L\xc3\xb6we(1)[2]{3}~@!+,^.obj"}));
}

TEST(Depfile, MakeSeesEveryDependency) {
  const testing::TemporaryFolder folder;
  const std::string odd = folder / "a b:c$d.obj";
  testing::write_text(odd, "x");
  testing::write_text(folder / "d", write_depfile("out", {odd}));
  testing::write_text(folder / "Makefile", "out:\n\t@touch out\n-include d\n");
  const auto make = [&](const char* query) {
    return testing::run_command({"make", "-C", folder.path().string(), query, "out"});
  };
  if (make("-s").exit_code == 127) GTEST_SKIP() << "no make";
  EXPECT_EQ(make("-q").exit_code, 0);
  ASSERT_EQ(testing::run_command({"touch", "-d", "next year", odd}).exit_code, 0);
  EXPECT_EQ(make("-q").exit_code, 1);
}

}  // namespace texmesh::depfile_test
