#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace texmesh::testing {

/// A folder of its own for a test, removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

struct CommandResult {
  int exit_code = -1;  // 128 + signal when it was killed
  std::string output;  // standard output
  std::string errors;  // standard error
  std::uint64_t peak_memory_bytes = 0;
};

/// Runs a program and waits for it (at most timeout_s, then it is killed). `environment` entries "NAME=value"
/// are added; `folder` is the working folder ("" = this one's).
CommandResult run_command(const std::vector<std::string>& arguments,
                          const std::vector<std::string>& environment = {}, const std::string& folder = "",
                          int timeout_s = 300);

void write_text(const std::string& path, const std::string& text);
std::string read_text(const std::string& path);  // the bytes of a file, "" when it is not there
std::vector<std::string> files_beneath(const std::string& folder);  // relative paths, sorted

}  // namespace texmesh::testing
