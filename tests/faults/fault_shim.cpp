// Preloaded (LD_PRELOAD) into every process of a build, this counts the calls that change what stands beneath
// given folders and lets one of them go wrong. The count is shared by all processes through a mapped file.
//
//   TEXMESH_FAULT_FILE    the shared file (tests/faults/fault_plan.h), made by the test
//   TEXMESH_FAULT_UNDER   folders, separated by ':'; absolute, no symbolic links
//   TEXMESH_FAULT_AT      the number of the call, from 1; 0 or absent = only count
//   TEXMESH_FAULT_ACTION  kill   the whole process group dies before the call (of a write, in its middle)
//                         eio    this call fails with EIO
//                         full   from this call on everything that needs space fails with ENOSPC;
//                                where this call is a write, the write's first half is written
//                         frozen from this call on the folders are read-only: EROFS
//                         choppy nothing fails, but of reads and writes every third is interrupted by a
//                         signal
//                                (EINTR), and the others move half of what they are asked to; no call number
//                         clock  nothing fails, but every second look at the time of day is a day early; no
//                                call number
//                         nolock no lock is granted: ENOLCK, as from NFS without its daemon; no call number
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <string_view>

#include "tests/faults/fault_plan.h"

namespace {

using texmesh::testing::FaultCall;
using texmesh::testing::FaultCounts;

enum class Action { kNone, kKill, kEio, kFull, kFrozen, kChoppy, kClock, kNoLock };

struct Plan {
  FaultCounts* counts = nullptr;
  std::string under;
  std::uint64_t at = 0;
  Action action = Action::kNone;

  Plan() {
    const auto variable = [](const char* name) {
      const char* v = std::getenv(name);
      return std::string(v ? v : "");
    };
    const std::string file = variable("TEXMESH_FAULT_FILE"), what = variable("TEXMESH_FAULT_ACTION");
    under = variable("TEXMESH_FAULT_UNDER");
    at = std::strtoull(variable("TEXMESH_FAULT_AT").c_str(), nullptr, 10);
    action = what == "kill"     ? Action::kKill
             : what == "eio"    ? Action::kEio
             : what == "full"   ? Action::kFull
             : what == "frozen" ? Action::kFrozen
             : what == "choppy" ? Action::kChoppy
             : what == "clock"  ? Action::kClock
             : what == "nolock" ? Action::kNoLock
                                : Action::kNone;
    using Open = int (*)(const char*, int, ...);
    const auto real = reinterpret_cast<Open>(::dlsym(RTLD_NEXT, "open"));
    const int fd = file.empty() ? -1 : real(file.c_str(), O_RDWR | O_CLOEXEC);
    if (fd < 0) return;
    void* place = ::mmap(nullptr, sizeof(FaultCounts), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (place != MAP_FAILED) counts = static_cast<FaultCounts*>(place);
    ::close(fd);
  }

  bool covers(std::string_view path) const {
    for (std::size_t begin = 0; begin < under.size();) {
      const std::size_t end = std::min(under.find(':', begin), under.size());
      const std::string_view folder = std::string_view(under).substr(begin, end - begin);
      if (path.starts_with(folder) && (path.size() == folder.size() || path[folder.size()] == '/'))
        return true;
      begin = end + 1;
    }
    return false;
  }
};

Plan& plan() {
  static Plan* const p = new Plan;  // never destroyed: calls come until the very end of a process
  return *p;
}

/// Before the process bounds itself: the counts lie where it will not be allowed to open files.
__attribute__((constructor)) void open_plan() { plan(); }

std::string path_of(int fd) {
  char target[PATH_MAX];
  const ssize_t n = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), target, sizeof target);
  return n > 0 ? std::string(target, static_cast<std::size_t>(n)) : "";
}

std::string path_of(int folder, const char* name) {
  if (name[0] == '/') return name;
  char here[PATH_MAX];
  const std::string base = folder == AT_FDCWD ? (::getcwd(here, sizeof here) ? here : "") : path_of(folder);
  return base + "/" + name;
}

bool needs_space(FaultCall call) { return call != FaultCall::kUnlink; }

struct Verdict {
  int error = 0;       // what the call must fail with
  bool kill = false;   // end everything
  bool first = false;  // the call that the plan names
};

Verdict judge(FaultCall call, const std::string& path) {
  Plan& p = plan();
  if (!p.counts || !p.covers(path)) return {};
  const std::uint64_t n = ++p.counts->calls;
  ++p.counts->of[static_cast<std::size_t>(call)];
  if (p.at == 0 || n < p.at) return {};
  const bool first = n == p.at;
  if (p.action == Action::kFull && needs_space(call)) {
    if (++p.counts->fired == 1) p.counts->fired_call = static_cast<std::uint32_t>(call);
    return {ENOSPC, false, first};
  }
  if (p.action == Action::kFrozen) {
    if (++p.counts->fired == 1) p.counts->fired_call = static_cast<std::uint32_t>(call);
    return {EROFS, false, first};
  }
  if (!first || p.action == Action::kFull) return {};
  ++p.counts->fired;
  p.counts->fired_call = static_cast<std::uint32_t>(call);
  return {p.action == Action::kEio ? EIO : 0, p.action == Action::kKill, true};
}

[[noreturn]] void kill_everything() {
  ::kill(0, SIGKILL);
  for (;;) ::pause();
}

/// Nothing when the call may be made.
bool refused(FaultCall call, const std::string& path) {
  const Verdict v = judge(call, path);
  if (v.kill) kill_everything();
  if (v.error != 0) errno = v.error;
  return v.error != 0;
}

/// How many of `count` bytes a read or write may move; -1 where a signal comes first.
ssize_t chopped(int fd, std::size_t count) {
  Plan& p = plan();
  if (p.action != Action::kChoppy || !p.counts || count < 2 || !p.covers(path_of(fd)))
    return static_cast<ssize_t>(count);
  if (++p.counts->fired % 3 != 0) return static_cast<ssize_t>(count / 2);
  errno = EINTR;
  return -1;
}

template <class F>
F real(const char* name) {
  return reinterpret_cast<F>(::dlsym(RTLD_NEXT, name));
}

bool creates(int flags) { return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE; }

int open_as(const char* name, int folder, const char* path, int flags, mode_t mode) {
  static const auto open_at = real<int (*)(int, const char*, int, ...)>(name);
  if (creates(flags) && refused(FaultCall::kOpen, path_of(folder, path))) return -1;
  return open_at(folder, path, flags, mode);
}

}  // namespace

extern "C" {

#define TEXMESH_MODE(flags)      \
  mode_t mode = 0;               \
  if (creates(flags)) {          \
    va_list rest;                \
    va_start(rest, flags);       \
    mode = va_arg(rest, mode_t); \
    va_end(rest);                \
  }

int open(const char* path, int flags, ...) {
  TEXMESH_MODE(flags)
  return open_as("openat", AT_FDCWD, path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  TEXMESH_MODE(flags)
  return open_as("openat", AT_FDCWD, path, flags, mode);
}
int openat(int folder, const char* path, int flags, ...) {
  TEXMESH_MODE(flags)
  return open_as("openat", folder, path, flags, mode);
}
int openat64(int folder, const char* path, int flags, ...) {
  TEXMESH_MODE(flags)
  return open_as("openat", folder, path, flags, mode);
}

ssize_t write(int fd, const void* bytes, size_t count) {
  static const auto call = real<ssize_t (*)(int, const void*, size_t)>("write");
  const Verdict v = judge(FaultCall::kWrite, path_of(fd));
  if (v.kill) {
    if (count > 1) (void)!call(fd, bytes, count / 2);
    kill_everything();
  }
  if (v.error == ENOSPC && v.first && count > 1) return call(fd, bytes, count / 2);
  if (v.error != 0) {
    errno = v.error;
    return -1;
  }
  const ssize_t most = chopped(fd, count);
  return most < 0 ? -1 : call(fd, bytes, static_cast<std::size_t>(most));
}
ssize_t read(int fd, void* bytes, size_t count) {
  static const auto call = real<ssize_t (*)(int, void*, size_t)>("read");
  const ssize_t most = chopped(fd, count);
  return most < 0 ? -1 : call(fd, bytes, static_cast<std::size_t>(most));
}
ssize_t pread(int fd, void* bytes, size_t count, off_t at) {
  static const auto call = real<ssize_t (*)(int, void*, size_t, off_t)>("pread");
  const ssize_t most = chopped(fd, count);
  return most < 0 ? -1 : call(fd, bytes, static_cast<std::size_t>(most), at);
}
ssize_t pread64(int fd, void* bytes, size_t count, off64_t at) { return pread(fd, bytes, count, at); }

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static const auto call = real<int (*)(clockid_t, timespec*)>("clock_gettime");
  constexpr time_t kDay_s = 86400;
  const int result = call(clock, time);
  Plan& p = plan();
  if (clock == CLOCK_REALTIME && result == 0 && p.counts && p.action == Action::kClock &&
      ++p.counts->fired % 2 == 0)
    time->tv_sec -= kDay_s;
  return result;
}

int flock(int fd, int operation) noexcept {
  static const auto call = real<int (*)(int, int)>("flock");
  Plan& p = plan();
  if (p.action != Action::kNoLock || !p.counts || !p.covers(path_of(fd))) return call(fd, operation);
  ++p.counts->fired;
  errno = ENOLCK;
  return -1;
}

int fsync(int fd) {
  static const auto call = real<int (*)(int)>("fsync");
  return refused(FaultCall::kSync, path_of(fd)) ? -1 : call(fd);
}
int fdatasync(int fd) {
  static const auto call = real<int (*)(int)>("fdatasync");
  return refused(FaultCall::kSync, path_of(fd)) ? -1 : call(fd);
}
int ftruncate(int fd, off_t length) noexcept {
  static const auto call = real<int (*)(int, off_t)>("ftruncate");
  return refused(FaultCall::kWrite, path_of(fd)) ? -1 : call(fd, length);
}
int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) noexcept {
  static const auto call = real<int (*)(int, const char*, int, const char*, int)>("linkat");
  if (refused(FaultCall::kLink, path_of(to_folder, to))) return -1;
  return call(from_folder, from, to_folder, to, flags);
}
int link(const char* from, const char* to) noexcept { return linkat(AT_FDCWD, from, AT_FDCWD, to, 0); }
int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  static const auto call = real<int (*)(int, const char*, int, const char*)>("renameat");
  if (refused(FaultCall::kRename, path_of(to_folder, to))) return -1;
  return call(from_folder, from, to_folder, to);
}
int rename(const char* from, const char* to) noexcept { return renameat(AT_FDCWD, from, AT_FDCWD, to); }
int unlinkat(int folder, const char* path, int flags) noexcept {
  static const auto call = real<int (*)(int, const char*, int)>("unlinkat");
  return refused(FaultCall::kUnlink, path_of(folder, path)) ? -1 : call(folder, path, flags);
}
int unlink(const char* path) noexcept { return unlinkat(AT_FDCWD, path, 0); }
int mkdirat(int folder, const char* path, mode_t mode) noexcept {
  static const auto call = real<int (*)(int, const char*, mode_t)>("mkdirat");
  return refused(FaultCall::kMkdir, path_of(folder, path)) ? -1 : call(folder, path, mode);
}
int mkdir(const char* path, mode_t mode) noexcept { return mkdirat(AT_FDCWD, path, mode); }

}  // extern "C"
