#include <filesystem>

#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/publish/report/report.h"

namespace texmesh {
namespace {

struct ReportArguments {
  std::string package, folder;
  ReportOptions options;
  int jobs = 0;
  bool json = false;
};

int run_report(const ReportArguments& args) {
  check_report_folder(args.folder);  // not after the work
  PackageReader package(open_store(args.package));
  const Report report = make_report(package, args.options, context_of(args.jobs));
  write_report(report, args.folder);
  if (args.json)
    std::cout << report_json(report) << '\n';
  else
    std::cout << report.verdict << '\n'
              << (std::filesystem::path(args.folder) / "index.html").string() << '\n';
  return report.holds ? kExitOk : kExitDifferent;
}

void add_options(Command& c, ReportArguments& args) {
  add_package_argument(c, args.package, true).required();
  c.option("-o,--output", args.folder,
           "The folder to make, with index.html in it. An earlier report is replaced; any other folder with "
           "files is refused")
      .required()
      .value_name("DIR");
  c.option("--against", args.options.against,
           "The model file behind the package: S_0 at the highest rung is rendered beside it")
      .value_name("SOURCE");
  c.option("--views", args.options.views, "Directions from which every switch size is rendered")
      .integer_in(1, 64)
      .shows_default();
  c.option("--max-flip", args.options.limits.mean,
           "Mean FLIP of a view up to which a scale cannot be told from S_0")
      .number_in(0, 1)
      .shows_default();
  c.option("--max-flip-p95", args.options.limits.p95, "The same for the 95th percentile of a view's pixels")
      .number_in(0, 1)
      .shows_default();
  add_jobs_option(c, args.jobs);
  c.flag("--json", args.json, "Print one JSON object (schemas/report.v1.schema.json)");
}

}  // namespace

void add_report_command(Command& app) {
  auto args = std::make_shared<ReportArguments>();
  Command c = app.add("report", "Write a page that shows what viewers of a package see");
  add_options(c, *args);
  c.examples(
      "  texmesh report bust.texmesh -o report/\n"
      "  texmesh report bust.texmesh -o report/ --against bust.glb\n"
      "  texmesh report bust.texmesh -o report/ --views 32 --max-flip 0.03 --json");
  c.notes(
      "The page has a verdict, pictures of each scale at its switch size beside S_0 with maps of FLIP, curves of "
      "quality against bytes, bytes by kind, maps of the fragments and the step function. The page needs no "
      "script and no network, and prints well.\n"
      "The same package gives the same files on every machine.\n"
      "Exit code: 0 every switch size holds, 4 one does not, 1 when the package or the source cannot be read "
      "or DIR not be written, 2 usage. With 4 the report is written, too.");
  c.on_run([args] { return run_report(*args); });
}

}  // namespace texmesh
