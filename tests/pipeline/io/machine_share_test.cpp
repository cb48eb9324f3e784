#include "pipeline/io/machine.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "tests/support/command.h"

namespace texmesh::machine_share_test {

constexpr std::uint64_t kGiB = 1ull << 30;

/// A machine of 16 processors and 64 GiB, with what a test writes beneath /proc and /sys.
class Machine : public ::testing::Test {
 protected:
  void file(const std::string& path, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(folder_ / path).parent_path());
    testing::write_text(folder_ / path, text);
  }
  MachineShare share() const {
    MachineView view;
    view.root = folder_.path().string();
    view.processors = 16;
    view.memory_bytes = 64 * kGiB;
    view.environment = [this](const char* name) -> const char* {
      const auto it = variables_.find(name);
      return it == variables_.end() ? nullptr : it->second.c_str();
    };
    return machine_share(view);
  }
  std::map<std::string, std::string> variables_;
  testing::TemporaryFolder folder_;
};

TEST_F(Machine, WithoutLimitsIsUsedWhole) {
  EXPECT_EQ(share().processors, 16);
  EXPECT_EQ(share().memory_bytes, 64 * kGiB);
  file("proc/self/cgroup", "0::/\n");
  file("sys/fs/cgroup/memory.max", "max\n");
  file("sys/fs/cgroup/cpu.max", "max 100000\n");
  EXPECT_EQ(share().processors, 16);
  EXPECT_EQ(share().memory_bytes, 64 * kGiB);
}

TEST_F(Machine, CgroupsOfVersionTwoAndThoseAboveThemLimit) {
  file("proc/self/cgroup", "0::/slice/job\n");
  file("sys/fs/cgroup/slice/memory.max", "4294967296\n");
  file("sys/fs/cgroup/slice/job/memory.max", "8589934592\n");
  file("sys/fs/cgroup/slice/job/cpu.max", "250000 100000\n");
  EXPECT_EQ(share().processors, 3);  // two and a half
  EXPECT_EQ(share().memory_bytes, 4 * kGiB);
}

TEST_F(Machine, CgroupsOfVersionOneLimit) {
  file("proc/self/cgroup", "9:name=systemd:/\n4:memory:/job\n2:cpuacct,cpu:/job\n0::/\n");
  file("sys/fs/cgroup/memory/job/memory.limit_in_bytes", "2147483648\n");
  file("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  file("sys/fs/cgroup/cpu/job/cpu.cfs_quota_us", "400000\n");
  file("sys/fs/cgroup/cpu/job/cpu.cfs_period_us", "100000\n");
  file("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  file("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(share().processors, 4);
  EXPECT_EQ(share().memory_bytes, 2 * kGiB);
}

TEST_F(Machine, AContainerSeesOnlyTheMountsRoot) {
  file("proc/self/cgroup", "0::/kubepods/pod1/container\n");
  file("sys/fs/cgroup/memory.max", "1073741824\n");
  EXPECT_EQ(share().memory_bytes, kGiB);
}

TEST_F(Machine, SlurmLimitsWhereNoCgroupDoes) {
  variables_ = {{"SLURM_CPUS_PER_TASK", "4"}, {"SLURM_MEM_PER_NODE", "8192"}};
  EXPECT_EQ(share().processors, 4);
  EXPECT_EQ(share().memory_bytes, 8 * kGiB);
  variables_ = {{"SLURM_CPUS_ON_NODE", "2"}, {"SLURM_MEM_PER_CPU", "1024"}};
  EXPECT_EQ(share().processors, 2);
  EXPECT_EQ(share().memory_bytes, 2 * kGiB);
  variables_ = {{"SLURM_CPUS_PER_TASK", "99"}, {"SLURM_MEM_PER_NODE", "0"}};  // 0: all
  EXPECT_EQ(share().processors, 16);
  EXPECT_EQ(share().memory_bytes, 64 * kGiB);
}

TEST_F(Machine, NonsenseLimitsNothing) {
  variables_ = {{"SLURM_CPUS_PER_TASK", "0"},
                {"SLURM_MEM_PER_NODE", "99999999999999999999"},
                {"SLURM_CPUS_ON_NODE", "many"}};
  file("proc/self/cgroup", "no colons\n0:\n::::\n0::/../../etc\n");
  file("sys/fs/cgroup/cpu.max", "0 0\n");
  file("sys/fs/cgroup/memory.max", "0\n");
  EXPECT_EQ(share().processors, 16);
  EXPECT_EQ(share().memory_bytes, 64 * kGiB);
}

TEST(ThisMachine, HasAProcessorAndMemory) {
  const MachineShare share = machine_share();
  EXPECT_GE(share.processors, 1);
  EXPECT_GT(share.memory_bytes, 1u << 20);
}

}  // namespace texmesh::machine_share_test
