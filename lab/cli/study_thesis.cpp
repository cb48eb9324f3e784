// texmesh-lab study thesis: the thesis's tables and figures, measured again.
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "lab/cli/commands.h"
#include "lab/thesis/exhibits.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/publish/report/report.h"

namespace texmesh {
namespace {

struct ThesisArguments {
  std::vector<std::string> exhibits;
  std::string folder;
  int jobs = 0;
  bool json = false;
};

std::vector<std::string> all_exhibit_ids() {
  std::vector<std::string> ids;
  for (const ExhibitGroup& group : exhibit_groups())
    ids.insert(ids.end(), group.ids.begin(), group.ids.end());
  return ids;
}

void write_page(const std::vector<Exhibit>& exhibits, const std::string& target) {
  NewFolder folder(target, report_folder_rule());
  folder.add(kReportPage, text_bytes(exhibits_html(exhibits)));
  for (const Exhibit& e : exhibits)
    for (const ExhibitPicture& p : e.pictures) folder.add(p.file, p.png);
  folder.publish();
}

int run_thesis(const ThesisArguments& args) {
  if (!args.folder.empty()) NewFolder(args.folder, report_folder_rule());  // not after the work
  const std::vector<Exhibit> exhibits = make_exhibits(args.exhibits, context_of(args.jobs));
  if (!args.folder.empty()) write_page(exhibits, args.folder);
  if (args.json) {
    std::cout << exhibits_json(exhibits).dump() << '\n';
  } else if (args.folder.empty()) {
    for (std::size_t k = 0; k < exhibits.size(); ++k)
      std::cout << (k ? "\n" : "") << exhibit_text(exhibits[k]);
  } else {
    std::cout << (std::filesystem::path(args.folder) / kReportPage).string() << '\n';
  }
  return kExitOk;
}

}  // namespace

void add_thesis_study(Command& study) {
  auto [c, args] = study.add(
      "thesis", "The thesis's tables and figures, measured again: printed values beside ours", run_thesis);
  c.option("--table", args.exhibits, "Only these, as 4.2,fig-6.2; without it all of them", "IDS")
      .separated_by(',')
      .one_of_explained(all_exhibit_ids());
  c.option("-o,--output", args.folder,
           "Write a page with plots and pictures into this folder, which is new or has an earlier page",
           "DIR");
  add_jobs_and_json_options(c, args.jobs, args.json);
  c.examples(
      "  texmesh-lab study thesis --table 4.2\n"
      "  texmesh-lab study thesis -o thesis/\n"
      "  texmesh-lab study thesis --table 7.1,7.2 --json");
  c.notes(
      "Models, pictures and links are made by code, since the thesis's are not available. All else is what compile and "
      "fetch run. Each table says what it was made from, and has a verdict: confirmed, in part, not confirmed, not "
      "comparable. The page needs no script and no network. The same bytes on every machine.\n"
      "Exit code: 0, 1 when DIR cannot be written, 2 usage, 3 internal error.");
}

}  // namespace texmesh
