#include "pipeline/compile/workers/sandbox/sandbox.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <filesystem>

#include "pipeline/compile/workers/sandbox/call_filter.h"
#include "pipeline/io/descriptor.h"

namespace texmesh {
namespace {

// What the headers of Debian 12 do not know yet.
struct RulesetAttributes {
  std::uint64_t files = 0, network = 0;
};
struct PortAttributes {
  std::uint64_t allowed = 0, port = 0;
};
constexpr std::uint64_t kTruncate = 1 << 14, kDeviceControl = 1 << 15;
constexpr std::uint64_t kBindTcp = 1, kConnectTcp = 2;
constexpr int kPathRule = 1, kPortRule = 2;
constexpr int kTruncateVersion = 3, kNetworkVersion = 4, kDeviceVersion = 5;

constexpr std::uint64_t kReadFile = LANDLOCK_ACCESS_FS_READ_FILE;
constexpr std::uint64_t kRead = kReadFile | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr std::uint64_t kWrite = kRead | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                                 LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_DIR |
                                 LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_REFER | kTruncate;
constexpr std::uint64_t kOfOneFile =
    LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_WRITE_FILE | kReadFile | kTruncate | kDeviceControl;

/// What libraries open long after they were loaded: further libraries, the time zone, the machine's shape.
constexpr const char* kSystemPaths[] = {"/usr",
                                        "/lib",
                                        "/lib64",
                                        "/etc/ld.so.cache",
                                        "/etc/localtime",
                                        "/proc/self",
                                        "/proc/cpuinfo",
                                        "/proc/meminfo",
                                        "/proc/stat",
                                        "/proc/sys/vm",
                                        "/sys/devices/system",
                                        "/sys/fs/cgroup",
                                        "/dev/urandom",
                                        "/dev/random",
                                        "/dev/zero"};
constexpr const char* kNamePaths[] = {
    "/etc/resolv.conf", "/etc/hosts", "/etc/nsswitch.conf", "/etc/host.conf",       "/etc/gai.conf",
    "/etc/services",    "/etc/ssl",   "/etc/pki",           "/etc/ca-certificates", "/run/systemd/resolve"};

int landlock_version() {
  const long version = ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  return version > 0 ? static_cast<int>(version) : 0;
}

class Ruleset {
 public:
  Ruleset(int version, bool every_port)
      : known_(known_files(version)),
        attributes_{known_, version >= kNetworkVersion && !every_port ? kBindTcp | kConnectTcp : 0} {
    const std::size_t bytes = version >= kNetworkVersion ? sizeof attributes_ : sizeof attributes_.files;
    fd_.reset(static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes_, bytes, 0)));
  }
  bool works() const { return fd_.get() >= 0; }

  void allow(const std::string& path, std::uint64_t access) {
    const Descriptor at(::open(path.c_str(), O_PATH | O_CLOEXEC));
    struct stat s {};
    if (at.get() < 0 || ::fstat(at.get(), &s) != 0) return;
    landlock_path_beneath_attr rule{};
    rule.allowed_access = access & known_ & (S_ISDIR(s.st_mode) ? ~0ull : kOfOneFile);
    rule.parent_fd = at.get();
    ::syscall(SYS_landlock_add_rule, fd_.get(), kPathRule, &rule, 0);
  }

  void allow_port(std::uint16_t port) {
    const PortAttributes rule{kConnectTcp, port};
    if (attributes_.network != 0) ::syscall(SYS_landlock_add_rule, fd_.get(), kPortRule, &rule, 0);
  }

  bool enforce() const { return ::syscall(SYS_landlock_restrict_self, fd_.get(), 0) == 0; }

 private:
  static std::uint64_t known_files(int version) {
    constexpr std::uint64_t kFirst = (1 << 13) - 1;
    return kFirst | LANDLOCK_ACCESS_FS_REFER | (version >= kTruncateVersion ? kTruncate : 0) |
           (version >= kDeviceVersion ? kDeviceControl : 0);
  }
  std::uint64_t known_;
  RulesetAttributes attributes_;
  Descriptor fd_;
};

/// Landlock binds the calling thread and its children only.
bool has_one_thread() {
  std::error_code ec;
  std::filesystem::directory_iterator threads("/proc/self/task", ec);
  return !ec && std::distance(begin(threads), end(threads)) == 1;
}

bool bound_files(const SandboxRules& rules, int version) {
  if (version < SandboxSupport::kLeastLandlock || !has_one_thread()) return false;
  Ruleset set(version, rules.network && rules.ports.empty());
  if (!set.works()) return false;
  for (const char* path : kSystemPaths) set.allow(path, kRead);
  set.allow("/dev/null", kReadFile | LANDLOCK_ACCESS_FS_WRITE_FILE);
  if (rules.network)
    for (const char* path : kNamePaths) set.allow(path, kRead);
  for (const std::string& path : rules.read) set.allow(path, kRead);
  for (const std::string& path : rules.write) set.allow(path, kWrite);
  for (const std::uint16_t port : rules.ports) set.allow_port(port);
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && set.enforce();
}

}  // namespace

SandboxSupport sandbox_support() { return {landlock_version(), has_call_filter()}; }

std::string describe_sandbox(const SandboxSupport& s) {
  const std::string files =
      s.landlock >= SandboxSupport::kLeastLandlock ? "files (Landlock " + std::to_string(s.landlock) + ")"
      : s.landlock > 0 ? "no bounds on files (Landlock " + std::to_string(s.landlock) + ", needs " +
                             std::to_string(SandboxSupport::kLeastLandlock) + ")"
                       : "no bounds on files (no Landlock)";
  return files + ", " + (s.seccomp ? "calls (seccomp)" : "no bounds on calls (no seccomp)");
}

SandboxSupport enter_sandbox(const SandboxRules& rules) {
  SandboxSupport held;
  const int version = landlock_version();
  if (bound_files(rules, version)) held.landlock = version;
  held.seccomp = filter_calls(rules.network);
  return held;
}

}  // namespace texmesh
