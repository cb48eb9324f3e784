#include "pipeline/report/report_folder.h"

#include "pipeline/report/html.h"

namespace texmesh {

FolderRule report_folder_rule() {
  return marked_folder_rule(kReportPage, kReportFirstLine, "an empty folder, an earlier report, or nothing yet");
}

}  // namespace texmesh
