#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace texmesh {

/// Where machine_share() looks; tests give it a machine made by code.
struct MachineView {
  std::string root;    // before /proc and /sys
  int processors = 0;  // this process may run on
  std::uint64_t memory_bytes = 0;
  std::function<const char*(const char* name)> environment;
};
/// This machine: sched_getaffinity, sysconf and the environment.
MachineView this_machine();

/// What this process may use of its machine.
struct MachineShare {
  int processors = 1;
  std::uint64_t memory_bytes = 0;  // 0 = not known
};

/// The least of: the processors of the affinity mask, the quotas of the cgroup (version 1 or 2) and of those
/// above it, rounded up, SLURM_CPUS_PER_TASK and SLURM_CPUS_ON_NODE; and of: the machine's memory, the limits
/// of these cgroups, and SLURM_MEM_PER_NODE or SLURM_MEM_PER_CPU (MiB, 0 = all). What cannot be read or is
/// no number limits nothing.
MachineShare machine_share(const MachineView& view = this_machine());

}  // namespace texmesh
