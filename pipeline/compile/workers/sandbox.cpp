// Bounds of a process that opens what strangers made: calls by seccomp, files and ports by Landlock; then
// what one model's process keeps.
#include "pipeline/compile/workers/sandbox.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>

#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <filesystem>

#include "pipeline/io/file_stamp.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

// What no compile needs, by what it would do.
constexpr long kOtherPrograms[] = {SYS_execve,           SYS_execveat,          SYS_ptrace,
                                   SYS_process_vm_readv, SYS_process_vm_writev, SYS_kcmp,
                                   SYS_pidfd_getfd,      SYS_personality};
constexpr long kMounts[] = {SYS_mount,      SYS_umount2, SYS_pivot_root, SYS_chroot,   SYS_open_tree,
                            SYS_move_mount, SYS_fsopen,  SYS_fsmount,    SYS_fsconfig, SYS_fspick};
constexpr long kKernel[] = {SYS_bpf,
                            SYS_perf_event_open,
                            SYS_userfaultfd,
                            SYS_io_uring_setup,
                            SYS_io_uring_enter,
                            SYS_io_uring_register,
                            SYS_keyctl,
                            SYS_add_key,
                            SYS_request_key};
constexpr long kNamespacesAndModules[] = {SYS_init_module, SYS_finit_module,    SYS_delete_module,
                                          SYS_kexec_load,  SYS_kexec_file_load, SYS_unshare,
                                          SYS_setns};
constexpr long kMachine[] = {SYS_reboot, SYS_swapon,       SYS_swapoff,       SYS_quotactl,
                             SYS_acct,   SYS_settimeofday, SYS_clock_settime, SYS_adjtimex};
constexpr long kClockAndHandles[] = {SYS_clock_adjtime, SYS_sethostname,       SYS_setdomainname,
                                     SYS_fanotify_init, SYS_open_by_handle_at, SYS_mknodat};
constexpr long kServers[] = {SYS_listen, SYS_accept, SYS_accept4};
#if defined(__x86_64__)
constexpr long kOfX86[] = {SYS_vfork, SYS_mknod, SYS_iopl, SYS_ioperm, SYS_modify_ldt};
#else
constexpr std::span<const long> kOfX86;
#endif
constexpr std::span<const long> kRefused[] = {
    kOtherPrograms, kMounts, kKernel, kNamespacesAndModules, kMachine, kClockAndHandles, kServers, kOfX86};
constexpr long kSocketCalls[] = {SYS_socket, SYS_socketpair, SYS_connect, SYS_bind,
                                 SYS_sendto, SYS_sendmsg,    SYS_sendmmsg};

class Program {
 public:
  Program() {
    load(offsetof(seccomp_data, arch));
    // Another architecture's numbers mean other calls.
    jump(BPF_JEQ, kArchitecture, 1, 0);
    answer(SECCOMP_RET_KILL_PROCESS);
    load(offsetof(seccomp_data, nr));
#if defined(__x86_64__)
    constexpr std::uint32_t kX32 = 0x40000000;
    jump(BPF_JGE, kX32, 0, 1);
    answer(SECCOMP_RET_ERRNO | EPERM);
#endif
  }

  void refuse(long call, int error = EPERM) {
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, 1);
    answer(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error));
  }

  /// Sockets of IP, of local services (the name cache) and of the kernel's routes, which looking up names
  /// asks for; no raw packets.
  void allow_client_sockets() {
    jump(BPF_JEQ, SYS_socket, 0, 7);
    load(offsetof(seccomp_data, args[0]));
    for (const int domain : {AF_UNIX, AF_INET, AF_INET6, AF_NETLINK}) {
      const auto after = static_cast<std::uint8_t>(domain == AF_UNIX    ? 4
                                                   : domain == AF_INET  ? 3
                                                   : domain == AF_INET6 ? 2
                                                                        : 1);
      jump(BPF_JEQ, static_cast<std::uint32_t>(domain), after, 0);
    }
    answer(SECCOMP_RET_ERRNO | EPERM);
    load(offsetof(seccomp_data, nr));
  }

  bool install() {
    answer(SECCOMP_RET_ALLOW);
    const sock_fprog program{static_cast<unsigned short>(code_.size()), code_.data()};
    return ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) == 0;
  }

 private:
  void load(std::size_t offset) {
    code_.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
  }
  void jump(std::uint16_t how, std::uint32_t value, std::uint8_t yes, std::uint8_t no) {
    code_.push_back(BPF_JUMP(static_cast<std::uint16_t>(BPF_JMP | how | BPF_K), value, yes, no));
  }
  void answer(std::uint32_t value) { code_.push_back(BPF_STMT(BPF_RET | BPF_K, value)); }

  std::vector<sock_filter> code_;
};

/// The kernel runs seccomp filters on this processor's calls.
bool has_call_filter() {
  std::uint32_t action = SECCOMP_RET_ERRNO;
  return kArchitecture != 0 && ::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) == 0;
}

/// Refuses calls with EPERM, in all threads of this process: starting programs, looking into other processes,
/// mounts, namespaces, keys, modules, clocks, io_uring; sockets of any kind unless `network`, which leaves
/// clients of IP and of local name services. False when the kernel takes no filter.
bool filter_calls(bool network) {
  if (!has_call_filter() || ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  Program program;
  for (const auto& calls : kRefused)
    for (const long call : calls) program.refuse(call);
  // Its flags lie in memory, where no filter can look: the C library falls back on clone.
  program.refuse(SYS_clone3, ENOSYS);
  if (network)
    program.allow_client_sockets();
  else
    for (const long call : kSocketCalls) program.refuse(call);
  return program.install();
}

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

/// Where symbolic links lead in the end; "" when nothing is there.
std::string real_path(const std::string& path) {
  std::error_code ec;
  const fs::path real = fs::canonical(path, ec);
  return ec ? "" : real.string();
}

/// "https://user:word@host:8443/cache" -> 8443
std::uint16_t port_of(const std::string& url) {
  const std::size_t begin = url.find("://") + 3, end = std::min(url.find_first_of("/?#", begin), url.size());
  const std::size_t colon = url.rfind(':', end);
  std::uint16_t port = url.starts_with("https") ? 443 : 80;
  // A colon before '@' stands in a credential, one before ']' in an address.
  if (colon != std::string::npos && colon >= begin && url.find_first_of("@]", colon) >= end)
    std::from_chars(url.data() + colon + 1, url.data() + end, port);
  return port;
}

bool has_proxy() {
  for (const char* name : {"http_proxy", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"})
    if (const char* value = std::getenv(name); value != nullptr && *value != '\0') return true;
  return false;
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

SandboxRules sandbox_rules(const WorkerPlaces& places) {
  SandboxRules rules;
  rules.read = {folder_of_file(places.input), real_path(places.input)};
  rules.read.insert(rules.read.end(), places.links_within.begin(), places.links_within.end());
  if (!places.program.empty())
    for (const char* modules : {"/../stages", "/../lib", "/../lib64"})
      rules.read.push_back(folder_of_file(places.program) + modules);
  if (!places.output.empty()) {
    rules.write.push_back(folder_of_file(places.output));
    if (const std::string real = real_path(places.output); !real.empty())
      rules.write.push_back(folder_of_file(real));
  }
  if (!places.cache.empty()) (places.only_looks ? rules.read : rules.write).push_back(places.cache);
  for (const std::string& layer : places.layers) {
    if (layer.find("://") == std::string::npos) {
      rules.read.push_back(layer);
    } else {
      rules.network = true;
      rules.ports.push_back(port_of(layer));
    }
  }
  constexpr std::uint16_t kNameServer = 53;
  if (rules.network) rules.ports.push_back(kNameServer);
  if (has_proxy()) rules.ports.clear();
  return rules;
}

}  // namespace texmesh
