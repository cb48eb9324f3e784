#include "pipeline/io/machine.h"

#include <sched.h>
#include <signal.h>

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "format/base/text_bytes.h"
#include "pipeline/io/file_stamp.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

/// The first two words of a file.
std::pair<std::string, std::string> words_of(const std::string& path) {
  std::ifstream in(path);
  std::pair<std::string, std::string> words;
  in >> words.first >> words.second;
  return words;
}

class Shares {
 public:
  explicit Shares(const MachineView& view) : view_(view) {
    share_.processors = std::max(1, view.processors);
    share_.memory_bytes = view.memory_bytes;
  }

  MachineShare find() {
    std::ifstream in(view_.root + "/proc/self/cgroup");
    for (std::string line; std::getline(in, line);) {
      const std::size_t first = line.find(':'), second = line.find(':', first + 1);
      if (second == std::string::npos) continue;
      const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
      const std::string path = line.substr(second + 1);
      if (controllers == ",,") look_at(view_.root + "/sys/fs/cgroup", path);
      for (const char* controller : {"memory", "cpu"})
        if (controllers.find("," + std::string(controller) + ",") != std::string::npos)
          look_at(view_.root + "/sys/fs/cgroup/" + controller, path);
    }
    look_at_slurm();
    return share_;
  }

 private:
  /// A cgroup and those above it. In a container, whose path is the host's, only the mount's root is there.
  void look_at(const std::string& mount, std::string path) {
    for (;;) {
      if (path == "/") path.clear();
      const std::string folder = mount + path;
      limit_memory(whole_number<std::uint64_t>(words_of(folder + "/memory.max").first));
      limit_memory(whole_number<std::uint64_t>(words_of(folder + "/memory.limit_in_bytes").first));
      const auto [quota, period] = words_of(folder + "/cpu.max");
      limit_processors(whole_number<std::uint64_t>(quota), whole_number<std::uint64_t>(period));
      limit_processors(whole_number<std::uint64_t>(words_of(folder + "/cpu.cfs_quota_us").first),
                       whole_number<std::uint64_t>(words_of(folder + "/cpu.cfs_period_us").first));
      if (path.empty()) return;
      path.resize(std::min(path.rfind('/'), path.size() - 1));
    }
  }

  void look_at_slurm() {
    for (const char* name : {"SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE"})
      limit_processors(variable(name), 1);
    constexpr std::uint64_t kMiB = 1 << 20, kMost = 1ull << 40;
    const auto of_node = variable("SLURM_MEM_PER_NODE"), of_cpu = variable("SLURM_MEM_PER_CPU");
    const auto processors = static_cast<std::uint64_t>(share_.processors);
    if (of_node && *of_node > 0 && *of_node < kMost) limit_memory(*of_node * kMiB);
    if (of_cpu && *of_cpu > 0 && *of_cpu < kMost) limit_memory(*of_cpu * processors * kMiB);
  }

  std::optional<std::uint64_t> variable(const char* name) const {
    const char* text = view_.environment ? view_.environment(name) : nullptr;
    return text ? whole_number<std::uint64_t>(text) : std::nullopt;
  }

  void limit_memory(std::optional<std::uint64_t> bytes) {
    if (bytes && *bytes > 0)
      share_.memory_bytes = share_.memory_bytes == 0 ? *bytes : std::min(share_.memory_bytes, *bytes);
  }

  void limit_processors(std::optional<std::uint64_t> quota, std::optional<std::uint64_t> period) {
    if (!quota || !period || *quota == 0 || *period == 0) return;
    const double processors = std::ceil(static_cast<double>(*quota) / static_cast<double>(*period));
    if (processors < share_.processors) share_.processors = static_cast<int>(processors);
  }

  const MachineView& view_;
  MachineShare share_;
};

constexpr std::size_t kMachineDigits = 12, kMostHostLetters = 16;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

std::string host_letters() {
  char name[256] = "";
  ::gethostname(name, sizeof name - 1);
  std::string letters;
  for (const char* c = name; *c != '\0' && *c != '.' && letters.size() < kMostHostLetters; ++c)
    if (std::isalnum(static_cast<unsigned char>(*c))) letters += *c;
  return letters.empty() ? "host" : letters;
}

/// "" where the system does not tell.
std::string machine_digits() {
  std::string boot;
  std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), boot);
  struct stat processes {};
  if (boot.empty() || ::stat("/proc/self/ns/pid", &processes) != 0) return "";
  const std::string text = boot + " " + std::to_string(processes.st_ino);
  return to_hex(sha256(text_bytes(text))).substr(0, kMachineDigits);
}

const std::string& machine_id() {
  static const std::string digits = machine_digits();
  return digits;
}

struct MarkParts {
  std::string_view machine;
  pid_t pid = 0;
};

bool read_mark(std::string_view mark, MarkParts& parts) {
  const std::size_t first = mark.find('-'), second = mark.find('-', first + 1);
  if (first == 0 || first == std::string_view::npos || second == std::string_view::npos) return false;
  parts.machine = mark.substr(first + 1, second - first - 1);
  parts.pid = whole_number<pid_t>(mark.substr(second + 1)).value_or(0);
  return parts.machine.size() == kMachineDigits &&
         parts.machine.find_first_not_of("0123456789abcdef") == std::string_view::npos && parts.pid > 0;
}

/// A process that has ended stays in the table until its parent asks, and some parents never do.
bool is_alive(pid_t pid) {
  if (::kill(pid, 0) != 0 && errno != EPERM) return false;
  std::string stat;
  std::getline(std::ifstream("/proc/" + std::to_string(pid) + "/stat"), stat);
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos || name_end + 2 >= stat.size()) return true;
  const char state = stat[name_end + 2];
  return state != 'Z' && state != 'X';
}

}  // namespace

MachineView this_machine() {
  MachineView view;
  cpu_set_t set;
  CPU_ZERO(&set);
  view.processors = ::sched_getaffinity(0, sizeof set, &set) == 0
                        ? CPU_COUNT(&set)
                        : static_cast<int>(std::thread::hardware_concurrency());
  const long pages = ::sysconf(_SC_PHYS_PAGES), page_bytes = ::sysconf(_SC_PAGE_SIZE);
  if (pages > 0 && page_bytes > 0)
    view.memory_bytes = static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page_bytes);
  view.environment = [](const char* name) -> const char* { return std::getenv(name); };
  return view;
}

MachineShare machine_share(const MachineView& view) { return Shares(view).find(); }

std::string owner_mark() {
  static const std::string host = host_letters();
  const std::string machine = machine_id().empty() ? std::string(kMachineDigits, '0') : machine_id();
  return host + "-" + machine + "-" + std::to_string(::getpid());
}

bool is_owner_mark(std::string_view text) {
  MarkParts parts;
  return read_mark(text, parts);
}

bool owner_may_live(std::string_view mark, std::int64_t modified_ns) {
  MarkParts parts;
  if (read_mark(mark, parts) && !machine_id().empty() && parts.machine == machine_id())
    return is_alive(parts.pid);
  return modified_ns > wall_clock_ns() - kDay_ns;
}

}  // namespace texmesh
