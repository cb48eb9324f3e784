// run_workers() with children that only say what they were started with.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "pipeline/compile/workers/worker.h"
#include "tests/support/command.h"

namespace texmesh::worker_pool_test {

namespace fs = std::filesystem;

/// Not a test alone: the pool starts the texmesh beside the program that it is in, so the tests below
/// let a copy of this one run.
TEST(WorkerPool, DISABLED_PrintWhatWorkersGet) {
  std::vector<WorkerJob> jobs(3);
  jobs[1].predicted_memory_bytes = 999'999'999;
  jobs[2].predicted_memory_bytes = 1'000'000'000;
  for (WorkerJob& job : jobs) job.profile = std::make_shared<const std::string>("{}");
  for (const WorkerReport& report : run_workers(jobs, {}, {}, {}))
    std::printf("worker: %s\n", report.more->error.found.c_str());
}

/// Of workers that are predicted to need nothing known, a little less than 1 GB, and 1 GB: what they have for
/// GLIBC_TUNABLES when the pool has `environment` beside this test's variables.
std::vector<std::string> tunables_of_workers(const std::vector<std::string>& environment) {
  const testing::TemporaryFolder folder;
  fs::copy_file(fs::read_symlink("/proc/self/exe"), folder / "pool");
  testing::write_text(folder / "texmesh", "#!/bin/sh\necho \"<${GLIBC_TUNABLES-none}>\" >&2\nexit 1\n");
  fs::permissions(folder / "texmesh", fs::perms::owner_all);
  const testing::CommandResult r = testing::run_command(
      {folder / "pool", "--gtest_also_run_disabled_tests", "--gtest_filter=*PrintWhatWorkersGet"},
      environment);
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  std::vector<std::string> out;
  for (std::size_t at = 0; (at = r.output.find('<', at)) != std::string::npos; ++at)
    out.push_back(r.output.substr(at + 1, r.output.find('>', at) - at - 1));
  return out;
}

TEST(WorkerPool, AWorkerOfALargeModelHasLargePages) {
  ::unsetenv("GLIBC_TUNABLES");
  EXPECT_EQ(tunables_of_workers({}), (std::vector<std::string>{"none", "none", "glibc.malloc.hugetlb=1"}));
}

TEST(WorkerPool, WorkersKeepTheUsersSettingOfMemory) {
  const std::string users = "glibc.malloc.arena_max=1";
  EXPECT_EQ(tunables_of_workers({"GLIBC_TUNABLES=" + users}), std::vector<std::string>(3, users));
}

}  // namespace texmesh::worker_pool_test
