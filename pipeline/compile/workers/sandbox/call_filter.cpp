#include "pipeline/compile/workers/sandbox/call_filter.h"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace texmesh {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

constexpr long kRefused[] = {
    SYS_execve,
    SYS_execveat,
    SYS_ptrace,
    SYS_process_vm_readv,
    SYS_process_vm_writev,
    SYS_kcmp,
    SYS_pidfd_getfd,
    SYS_mount,
    SYS_umount2,
    SYS_pivot_root,
    SYS_chroot,
    SYS_unshare,
    SYS_setns,
    SYS_open_tree,
    SYS_move_mount,
    SYS_fsopen,
    SYS_fsmount,
    SYS_fsconfig,
    SYS_fspick,
    SYS_bpf,
    SYS_perf_event_open,
    SYS_userfaultfd,
    SYS_io_uring_setup,
    SYS_io_uring_enter,
    SYS_io_uring_register,
    SYS_keyctl,
    SYS_add_key,
    SYS_request_key,
    SYS_init_module,
    SYS_finit_module,
    SYS_delete_module,
    SYS_kexec_load,
    SYS_kexec_file_load,
    SYS_reboot,
    SYS_swapon,
    SYS_swapoff,
    SYS_quotactl,
    SYS_acct,
    SYS_settimeofday,
    SYS_clock_settime,
    SYS_adjtimex,
    SYS_clock_adjtime,
    SYS_sethostname,
    SYS_setdomainname,
    SYS_personality,
    SYS_fanotify_init,
    SYS_open_by_handle_at,
    SYS_mknodat,
    SYS_listen,
    SYS_accept,
    SYS_accept4,
#if defined(__x86_64__)
    SYS_vfork,
    SYS_mknod,
    SYS_iopl,
    SYS_ioperm,
    SYS_modify_ldt,
#endif
};
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

}  // namespace

bool has_call_filter() {
  std::uint32_t action = SECCOMP_RET_ERRNO;
  return kArchitecture != 0 && ::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) == 0;
}

bool filter_calls(bool network) {
  if (!has_call_filter() || ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  Program program;
  for (const long call : kRefused) program.refuse(call);
  // Its flags lie in memory, where no filter can look: the C library falls back on clone.
  program.refuse(SYS_clone3, ENOSYS);
  if (network)
    program.allow_client_sockets();
  else
    for (const long call : kSocketCalls) program.refuse(call);
  return program.install();
}

}  // namespace texmesh
