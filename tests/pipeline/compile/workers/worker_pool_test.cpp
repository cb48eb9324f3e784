// run_workers() with children that only say what they were started with.
#include <gtest/gtest.h>

#include <sys/resource.h>

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
  for (WorkerJob& job : jobs) job.profile = std::make_shared<const std::string>("{}");
  for (const WorkerReport& report : run_workers(jobs, {}, {}, {}))
    std::printf("worker: %s\n", report.more->error.found.c_str());
}

/// One of the disabled tests, in a copy of this program beside a texmesh that is that script.
testing::CommandResult run_copy(const std::string& test, const std::string& script,
                                const std::vector<std::string>& environment) {
  const testing::TemporaryFolder folder;
  fs::copy_file(fs::read_symlink("/proc/self/exe"), folder / "pool");
  testing::write_text(folder / "texmesh", "#!/bin/sh\n" + script + "\n");
  fs::permissions(folder / "texmesh", fs::perms::owner_all);
  testing::CommandResult r = testing::run_command(
      {folder / "pool", "--gtest_also_run_disabled_tests", "--gtest_filter=*" + test}, environment);
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  return r;
}

/// What three workers have for GLIBC_TUNABLES when the pool has `environment` beside this test's variables.
std::vector<std::string> tunables_of_workers(const std::vector<std::string>& environment) {
  const testing::CommandResult r =
      run_copy("PrintWhatWorkersGet", "echo \"<${GLIBC_TUNABLES-none}>\" >&2\nexit 1", environment);
  std::vector<std::string> out;
  for (std::size_t at = 0; (at = r.output.find('<', at)) != std::string::npos; ++at)
    out.push_back(r.output.substr(at + 1, r.output.find('>', at) - at - 1));
  return out;
}

TEST(WorkerPool, WorkersHaveLargePages) {
  ::unsetenv("GLIBC_TUNABLES");
  EXPECT_EQ(tunables_of_workers({}), std::vector<std::string>(3, "glibc.malloc.hugetlb=1"));
}

TEST(WorkerPool, WorkersKeepTheUsersSettingOfMemory) {
  const std::string users = "glibc.malloc.arena_max=1";
  EXPECT_EQ(tunables_of_workers({"GLIBC_TUNABLES=" + users}), std::vector<std::string>(3, users));
}

/// As the test above: with files for two workers at once, and for none.
TEST(WorkerPool, DISABLED_RunWithFewFiles) {
  std::vector<WorkerJob> jobs(6);
  for (WorkerJob& job : jobs) job.profile = std::make_shared<const std::string>("{}");
  PoolSettings settings;
  settings.processors = 3;
  ::close_range(3, ~0u, 0);
  for (const rlim_t files : {rlim_t{12}, rlim_t{8}}) {
    const rlimit limit{files, 12};
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
    for (const WorkerReport& report : run_workers(jobs, settings, {}, {}))
      std::printf("<%s %s>", report.more->error.kind.c_str(), report.more->error.found.c_str());
  }
}

TEST(WorkerPool, WorkersThatCannotStartWaitForOthersAndFailAlone) {
  const testing::CommandResult r = run_copy("RunWithFewFiles", "echo told >&2; exec sleep 0.2", {});
  std::string expected;
  for (int i = 0; i < 6; ++i) expected += "<internal exit code 0: told\n>";
  for (int i = 0; i < 6; ++i) expected += "<resource pipe: Too many open files>";
  EXPECT_NE(r.output.find(expected), std::string::npos) << r.output;
}

}  // namespace texmesh::worker_pool_test
