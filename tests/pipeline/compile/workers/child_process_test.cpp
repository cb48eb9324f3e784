#include "pipeline/compile/workers/worker.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace texmesh::child_process_test {

using Strings = std::vector<std::string>;

/// The variables of that name.
Strings of(const std::string& name, const Strings& variables) {
  Strings out;
  for (const std::string& v : variables)
    if (v.starts_with(name + "=")) out.push_back(v);
  return out;
}

TEST(ChildProcess, GetsLargePages) {
  ::unsetenv("GLIBC_TUNABLES");
  ::setenv("TEXMESH_TEST_WORD", "a b=c", 1);
  const Strings variables = worker_environment();
  EXPECT_EQ(of("TEXMESH_TEST_WORD", variables), Strings{"TEXMESH_TEST_WORD=a b=c"});
  EXPECT_EQ(of("GLIBC_TUNABLES", variables), Strings{"GLIBC_TUNABLES=glibc.malloc.hugetlb=1"});
}

TEST(ChildProcess, WhatTheUserHasSetOfMemoryStays) {
  ::setenv("GLIBC_TUNABLES", "glibc.malloc.arena_max=1", 1);
  EXPECT_EQ(of("GLIBC_TUNABLES", worker_environment()), Strings{"GLIBC_TUNABLES=glibc.malloc.arena_max=1"});
}

}  // namespace texmesh::child_process_test
