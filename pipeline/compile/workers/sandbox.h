#pragma once

#include "format/base/fields.h"

namespace texmesh {

/// auto = what the kernel can do; require = no model is opened where that is not everything; off = none.
enum class SandboxMode : std::uint8_t { kAuto, kRequire, kOff };
template <>
struct EnumNames<SandboxMode> {
  static constexpr std::array<std::string_view, 3> names{"auto", "require", "off"};
};

/// What this kernel can enforce.
struct SandboxSupport {
  int landlock = 0;  // version of the interface, 0 = none
  bool seccomp = false;
  /// Files and calls are both bounded. Older versions of Landlock let files be cut short or forbid renaming.
  bool complete() const { return landlock >= kLeastLandlock && seccomp; }
  static constexpr int kLeastLandlock = 3;
};
SandboxSupport sandbox_support();

/// "files (Landlock 7), calls (seccomp)", or what is missing.
std::string describe_sandbox(const SandboxSupport& support);

/// What a process keeps when it enters the sandbox.
struct SandboxRules {
  std::vector<std::string> read;     // files, and folders with all beneath them
  std::vector<std::string> write;    // folders: also made, renamed and removed beneath them
  bool network = false;              // TCP and the look-up of names
  std::vector<std::uint16_t> ports;  // the network's only ports, where Landlock 4 is there; none = every port
};

/// Gives up, for this process and for good: files outside of the rules (the system's libraries, time zone,
/// names and certificates stay readable), starting programs, looking into other processes, mounts, keys,
/// io_uring, and sockets unless the rules allow them. What is refused fails with EACCES or EPERM. To be
/// called before the process has a second thread. Paths that are not there are left out. Returns what holds;
/// with less than complete() the process goes on with what could be had.
SandboxSupport enter_sandbox(const SandboxRules& rules);

/// The places that one model's process has to do with; "" = none.
struct WorkerPlaces {
  std::string input, output, cache;
  std::string program;  // the executable, by whose folder the modules that it loads later are found
  std::vector<std::string> layers;        // folders and URLs
  std::vector<std::string> links_within;  // folders that symbolic links of the model may lead into
  bool only_looks = false;                // the cache is read only
};

/// What the process keeps: its modules (../stages of a build tree, ../../lib of an installation), the model's
/// folder, the file that the model is a link to and the folders of its links are read, the result's folder
/// and the cache are written, layers are read. With layers that are URLs: the network, to the ports of these
/// URLs and of name servers, or to every port where the environment names a proxy.
SandboxRules sandbox_rules(const WorkerPlaces& places);

}  // namespace texmesh
