#pragma once
#include <span>
#include <string_view>

namespace texmesh {

/// A file of page/, as the build puts it into the program.
struct PageFile {
  std::string_view name, text;
};
std::span<const PageFile> page_files();

}  // namespace texmesh
