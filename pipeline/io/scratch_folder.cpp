#include "pipeline/io/scratch_folder.h"

#include <stdlib.h>

#include "format/base/errors.h"

namespace texmesh {
namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const std::string& name) {
  std::string made = (fs::temp_directory_path() / (name + "-XXXXXX")).string();
  if (!::mkdtemp(made.data())) throw InputError(made, "", "a folder that can be made", "an error");
  path_ = made;
}

ScratchFolder::~ScratchFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

}  // namespace texmesh
