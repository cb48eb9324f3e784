#pragma once
#include "pipeline/io/new_folder.h"

namespace texmesh {

/// The page of a folder that html_page() fills.
inline constexpr const char* kReportPage = "index.html";

/// A folder is new or empty, or it holds such a page and is replaced.
FolderRule report_folder_rule();

}  // namespace texmesh
