#include "pipeline/compile/workers/child_process.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

namespace texmesh {
namespace {

std::ptrdiff_t tunables_in(const std::vector<std::string>& variables) {
  return std::ranges::count_if(variables,
                               [](const std::string& v) { return v.starts_with("GLIBC_TUNABLES="); });
}

TEST(ChildProcess, LargeModelsGetLargePages) {
  ::unsetenv("GLIBC_TUNABLES");
  ::setenv("TEXMESH_TEST_WORD", "a b=c", 1);
  const std::vector<std::string> small = worker_environment(false), large = worker_environment(true);
  for (const auto& variables : {small, large})
    EXPECT_EQ(std::ranges::count(variables, "TEXMESH_TEST_WORD=a b=c"), 1);
  EXPECT_EQ(tunables_in(small), 0);
  EXPECT_EQ(tunables_in(large), 1);
  EXPECT_EQ(large.size(), small.size() + 1);
}

TEST(ChildProcess, WhatTheUserHasSetOfMemoryStays) {
  ::setenv("GLIBC_TUNABLES", "glibc.malloc.arena_max=1", 1);
  const std::vector<std::string> variables = worker_environment(true);
  EXPECT_EQ(tunables_in(variables), 1);
  EXPECT_EQ(std::ranges::count(variables, "GLIBC_TUNABLES=glibc.malloc.arena_max=1"), 1);
  ::unsetenv("GLIBC_TUNABLES");
}

}  // namespace
}  // namespace texmesh
