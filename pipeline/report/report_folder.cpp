#include "pipeline/report/report_folder.h"

#include <array>
#include <fstream>
#include <string_view>

#include "pipeline/report/html.h"

namespace texmesh {
namespace {

bool holds_report(const std::filesystem::path& folder) {
  std::ifstream page(folder / kReportPage, std::ios::binary);
  std::array<char, kReportFirstLine.size()> head{};
  page.read(head.data(), static_cast<std::streamsize>(head.size()));
  return page && std::string_view(head.data(), head.size()) == kReportFirstLine;
}

}  // namespace

FolderRule report_folder_rule() {
  return {true, holds_report, "", "an empty folder, an earlier report, or nothing yet"};
}

}  // namespace texmesh
