// Where workers come from: a process of their own, or a copy of one that has loaded its libraries already.
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include "format/base/descriptor.h"
#include "format/base/text_bytes.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/compile/workers/worker.h"
#include "pipeline/io/program.h"
#include "pipeline/io/resolver.h"

extern char** environ;

namespace texmesh {
namespace {

[[noreturn]] void fail_to_start(const std::string& step, int error) {
  throw ResourceError("texmesh", "", "a process for a model", step + ": " + std::strerror(error));
}

struct Pipe {
  Descriptor read, write;
  Pipe() {
    int fds[2];
    if (::pipe2(fds, O_CLOEXEC) != 0) fail_to_start("pipe", errno);
    read.reset(fds[0]);
    write.reset(fds[1]);
  }
};

using StandardFiles = std::array<int, 3>;

/// Starts texmesh with that only argument (posix_spawn, never a fork of a threaded parent); -1 in `files`
/// leaves this process's. Throws ResourceError.
pid_t start_texmesh(std::string argument, const StandardFiles& files) {
  static const std::string executable = worker_executable();
  std::vector<std::string> variables = worker_environment();
  std::vector<char*> environment;
  for (std::string& variable : variables) environment.push_back(variable.data());
  environment.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (int i = 0; i < 3; ++i)
    if (const int file = files[static_cast<std::size_t>(i)]; file >= 0)
      posix_spawn_file_actions_adddup2(&actions, file, i);
  std::string name = "texmesh";
  char* argv[] = {name.data(), argument.data(), nullptr};
  pid_t pid = -1;
  const int rc = ::posix_spawn(&pid, executable.c_str(), &actions, nullptr, argv, environment.data());
  posix_spawn_file_actions_destroy(&actions);
  if (rc != 0) fail_to_start("posix_spawn", rc);
  return pid;
}

/// A message of one byte with a worker's files.
struct FilesMessage {
  char byte = 0;
  iovec text{&byte, 1};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(StandardFiles))] = {};
  msghdr head{};
  FilesMessage() {
    head.msg_iov = &text;
    head.msg_iovlen = 1;
    head.msg_control = control;
    head.msg_controllen = sizeof control;
  }
};

bool send_files(int socket, const StandardFiles& files) {
  FilesMessage message;
  cmsghdr* const part = CMSG_FIRSTHDR(&message.head);
  part->cmsg_level = SOL_SOCKET;
  part->cmsg_type = SCM_RIGHTS;
  part->cmsg_len = CMSG_LEN(sizeof files);
  std::memcpy(CMSG_DATA(part), files.data(), sizeof files);
  return ::sendmsg(socket, &message.head, MSG_NOSIGNAL) == 1;
}

std::optional<StandardFiles> receive_files(int socket) {
  FilesMessage message;
  if (::recvmsg(socket, &message.head, MSG_CMSG_CLOEXEC) != 1) return std::nullopt;
  const cmsghdr* const part = CMSG_FIRSTHDR(&message.head);
  if (!part || part->cmsg_type != SCM_RIGHTS || part->cmsg_len != CMSG_LEN(sizeof(StandardFiles)))
    return std::nullopt;
  StandardFiles files;
  std::memcpy(files.data(), CMSG_DATA(part), sizeof files);
  return files;
}

}  // namespace

std::vector<std::string> worker_environment() {
  std::vector<std::string> variables;
  for (char** variable = environ; variable && *variable; ++variable) variables.emplace_back(*variable);
  if (!::getenv("GLIBC_TUNABLES")) variables.emplace_back("GLIBC_TUNABLES=glibc.malloc.hugetlb=1");
  return variables;
}

WorkerOrigin::WorkerOrigin([[maybe_unused]] std::size_t workers) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they know no process that is a copy
  constexpr std::size_t kWorthCopying = 3;
  int ends[2];
  if (workers < kWorthCopying || ::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) return;
  Descriptor here(ends[0]), there(ends[1]);
  try {
    pid_ = start_texmesh("worker-origin", {there.get(), -1, -1});
    socket_ = here.release();
  } catch (const ResourceError&) {  // each worker is started anew
  }
#endif
}

WorkerOrigin::~WorkerOrigin() { end(); }

void WorkerOrigin::end() {
  if (socket_ < 0) return;
  ::close(socket_);
  socket_ = -1;
  ::waitpid(pid_, nullptr, 0);
}

pid_t WorkerOrigin::copy(const StandardFiles& files) {
  pid_t pid = -1;
  if (socket_ >= 0 && (!send_files(socket_, files) || ::recv(socket_, &pid, sizeof pid, 0) != sizeof pid))
    end();
  return pid;
}

ChildProcess WorkerOrigin::start(const std::string& input) {
  ChildProcess child;
  Pipe in, out, err;
  const StandardFiles files{in.read.get(), out.write.get(), err.write.get()};
  child.pid = copy(files);
  if (child.pid < 0) child.pid = start_texmesh("worker", files);
  for (Descriptor* const end : {&in.read, &out.write, &err.write}) end->reset();
  write_all(in.write.get(), text_bytes(input));  // a child that is gone says the rest by its exit status
  child.out = out.read.release();
  child.err = err.read.release();
  for (int fd : {child.out, child.err}) ::fcntl(fd, F_SETFL, O_NONBLOCK);
  child.start = std::chrono::steady_clock::now();
  return child;
}

int worker_origin_main() {
  ::signal(SIGINT, SIG_IGN);  // the parent decides
  default_stage_table();      // what every worker makes
  while (const auto files = receive_files(0)) {
    // A child of this process's parent, which waits for it. No thread but this one has been started.
    const auto pid =
        static_cast<pid_t>(::syscall(SYS_clone, CLONE_PARENT | SIGCHLD, nullptr, nullptr, nullptr, nullptr));
    if (pid == 0) {
      for (int i = 0; i < 3; ++i) ::dup2((*files)[static_cast<std::size_t>(i)], i);
      for (const int fd : *files) ::close(fd);
      return worker_main();
    }
    for (const int fd : *files) ::close(fd);
    if (::send(0, &pid, sizeof pid, MSG_NOSIGNAL) != sizeof pid) break;
  }
  return 0;
}

}  // namespace texmesh
