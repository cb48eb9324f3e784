#include "pipeline/compile/workers/child_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "pipeline/io/program.h"

extern char** environ;

namespace texmesh {
namespace {

struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    int fds[2];
    if (::pipe2(fds, O_CLOEXEC) != 0) throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
    read = fds[0];
    write = fds[1];
  }
};

void write_all(int fd, const std::string& text) {
  std::size_t at = 0;
  while (at < text.size()) {
    const ssize_t n = ::write(fd, text.data() + at, text.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return;  // the child is gone; its exit status says the rest
    at += static_cast<std::size_t>(n);
  }
}

}  // namespace

std::vector<std::string> worker_environment(bool large_pages) {
  std::vector<std::string> variables;
  for (char** variable = environ; variable && *variable; ++variable) variables.emplace_back(*variable);
  if (large_pages && !::getenv("GLIBC_TUNABLES"))
    variables.emplace_back("GLIBC_TUNABLES=glibc.malloc.hugetlb=1");
  return variables;
}

ChildProcess start_worker_process(const std::string& input, bool large_pages) {
  static const std::string executable = worker_executable();
  std::vector<std::string> variables = worker_environment(large_pages);
  std::vector<char*> environment;
  for (std::string& variable : variables) environment.push_back(variable.data());
  environment.push_back(nullptr);
  ChildProcess child;
  Pipe in, out, err;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in.read, 0);
  posix_spawn_file_actions_adddup2(&actions, out.write, 1);
  posix_spawn_file_actions_adddup2(&actions, err.write, 2);
  std::string name = "texmesh", command = "worker";
  char* argv[] = {name.data(), command.data(), nullptr};
  const int rc = ::posix_spawn(&child.pid, executable.c_str(), &actions, nullptr, argv, environment.data());
  posix_spawn_file_actions_destroy(&actions);
  ::close(in.read);
  ::close(out.write);
  ::close(err.write);
  if (rc != 0) throw std::runtime_error(std::string("cannot start a worker: ") + std::strerror(rc));
  write_all(in.write, input);
  ::close(in.write);
  child.out = out.read;
  child.err = err.read;
  for (int fd : {child.out, child.err}) ::fcntl(fd, F_SETFL, O_NONBLOCK);
  child.start = std::chrono::steady_clock::now();
  return child;
}

bool read_available(int fd, std::string& into) {
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::read(fd, buffer, sizeof buffer);
    if (n > 0)
      into.append(buffer, static_cast<std::size_t>(n));
    else if (n == 0)
      return false;
    else if (errno != EINTR)
      return errno == EAGAIN;
  }
}

void close_fd(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

}  // namespace texmesh
