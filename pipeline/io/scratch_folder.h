#pragma once
#include <filesystem>
#include <string>

namespace texmesh {

/// A new folder among the machine's temporary ones, which goes with this object and all that is in it.
class ScratchFolder {
 public:
  /// `name`: what its name begins with. InputError where it cannot be made.
  explicit ScratchFolder(const std::string& name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace texmesh
