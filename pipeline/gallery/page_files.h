#pragma once
#include <span>

#include "pipeline/io/pages/built_in_file.h"

namespace texmesh {

/// The files of page/: what a gallery is made of.
std::span<const BuiltInFile> gallery_page_files();

}  // namespace texmesh
