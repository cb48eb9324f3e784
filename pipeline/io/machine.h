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

/// Who makes a file in a folder that several machines share: "HOST-MACHINE-PID". HOST is for readers. MACHINE
/// is a digest of the kernel's boot and of the namespace of process numbers, equal only where PID means the
/// same process; zeros where the system does not tell, and nobody can then say whether the process lives.
std::string owner_mark();

/// Whether the process that made a file may still be at work. Of this machine: while it lives. Of another
/// machine, or where `mark` is no owner_mark(): until the file has not been changed for a day, which no
/// writer takes. Locks are not asked: Lustre and NFS may grant them to everybody.
bool owner_may_live(std::string_view mark, std::int64_t modified_ns);

/// Whether a text has the form of an owner_mark().
bool is_owner_mark(std::string_view text);

}  // namespace texmesh
