#pragma once
#include <span>

#include "tools/publish/pages/page.h"

namespace texmesh {

/// The files of page/.
std::span<const BuiltInFile> experiment_page_files();

}  // namespace texmesh
