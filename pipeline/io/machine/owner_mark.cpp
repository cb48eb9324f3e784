#include "pipeline/io/machine/owner_mark.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <fstream>

#include "format/base/text_bytes.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {
namespace {

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
  const std::string_view pid = mark.substr(second + 1);
  const auto [end, error] = std::from_chars(pid.data(), pid.data() + pid.size(), parts.pid);
  return parts.machine.size() == kMachineDigits &&
         parts.machine.find_first_not_of("0123456789abcdef") == std::string_view::npos &&
         error == std::errc() && end == pid.data() + pid.size() && parts.pid > 0;
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
