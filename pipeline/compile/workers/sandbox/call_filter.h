#pragma once

namespace texmesh {

/// The kernel runs seccomp filters on this processor's calls.
bool has_call_filter();

/// Refuses calls with EPERM, in all threads of this process: starting programs, looking into other processes,
/// mounts, namespaces, keys, modules, clocks, io_uring; sockets of any kind unless `network`, which leaves
/// clients of IP and of local name services. False when the kernel takes no filter.
bool filter_calls(bool network);

}  // namespace texmesh
