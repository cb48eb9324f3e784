#include "pipeline/io/core_path.h"

#include <unistd.h>

#include <filesystem>

#include "format/base/errors.h"

namespace texmesh {

std::string core_executable() {
  namespace fs = std::filesystem;
  std::error_code ec;
  const fs::path self = fs::read_symlink("/proc/self/exe", ec);
  const fs::path folder = self.parent_path();
  for (const fs::path& candidate : {folder / "texmesh-core", folder / "../libexec/texmesh/texmesh-core"})
    if (::access(candidate.c_str(), X_OK) == 0) return candidate.lexically_normal().string();
  throw InputError("texmesh-core", "", "an executable beside " + self.string() + " or in ../libexec/texmesh",
                   "nothing there");
}

}  // namespace texmesh
