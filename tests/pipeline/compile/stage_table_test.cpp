#include "pipeline/compile/stage_table.h"

#include <gtest/gtest.h>

#include <set>

namespace texmesh {
namespace {

TEST(StageTable, EveryInputIsMadeBeforeItIsUsedAndEveryOptionIsRead) {
  std::set<std::string> made{"source", "provenance"}, read;
  for (const Stage& s : stage_table()) {
    for (const std::string& input : s.inputs)
      EXPECT_TRUE(made.contains(input)) << s.name << " reads " << input;
    for (const Artefact& a : s.outputs) EXPECT_TRUE(made.insert(a.name).second) << a.name;
    read.insert(s.options.begin(), s.options.end());
    EXPECT_GE(s.version, 1);
  }
  CompileOptions o;
  for (const OptionField& f : list_options(o))
    EXPECT_TRUE(read.contains(f.stage)) << f.path() << " is in no key";
}

}  // namespace
}  // namespace texmesh
