#pragma once
#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace texmesh {

/// A running child process. Its owner waits for `pid` and closes the descriptors.
struct ChildProcess {
  pid_t pid = -1;
  int out = -1, err = -1;  // its standard output and error; reading them does not block
  std::chrono::steady_clock::time_point start;
};

/// This process's variables for a worker, as NAME=value. With `large_pages` glibc asks the system for large
/// pages (2 MiB on x86-64), unless GLIBC_TUNABLES is set already.
std::vector<std::string> worker_environment(bool large_pages);

/// Starts `texmesh worker` (posix_spawn, never a fork of a threaded parent) in worker_environment() and
/// gives it `input` as the whole of its standard input. Throws std::runtime_error.
ChildProcess start_worker_process(const std::string& input, bool large_pages);

/// Appends what can be read now; false at the end of the file.
bool read_available(int fd, std::string& into);

/// Closes a descriptor that is open and sets it to -1.
void close_fd(int& fd);

}  // namespace texmesh
