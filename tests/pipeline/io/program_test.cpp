// What is known of the program that runs, and of the one that workers are.
#include "pipeline/io/program.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "format/base/errors.h"

namespace texmesh::program_test {

TEST(Program, ABuildHasOneName) {
  EXPECT_FALSE(program_build().empty());
  EXPECT_EQ(program_build(), program_build());
}

TEST(Program, OneThatServesNoWorkersNeedsTexmeshBesideIt) {
  EXPECT_THROW(worker_executable(), InputError);
  serve_workers();
  EXPECT_EQ(worker_executable(), std::filesystem::read_symlink("/proc/self/exe").string());
}

}  // namespace texmesh::program_test
