#pragma once
#include <span>

#include "tools/publish/pages/built_in_file.h"

namespace texmesh {

/// The files of page/: what a site is made of.
std::span<const BuiltInFile> site_page_files();

}  // namespace texmesh
