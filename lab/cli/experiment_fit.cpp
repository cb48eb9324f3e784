// texmesh-lab experiment fit: thresholds from what judges have answered.
#include <fmt/format.h>

#include "format/base/text_bytes.h"
#include "lab/cli/commands.h"
#include "lab/experiment/fit_experiment.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMaxDesignFile = 16u << 20;
constexpr std::size_t kMaxFiles = 10000;

struct FitArguments {
  std::vector<std::string> files;
  std::string profile, page, design, curve = "sigmoid";
  int draws = FitOptions{}.draws;
  std::uint64_t seed = 1;
  int jobs = 0;
  bool skip = false, json = false;
};

std::vector<ExperimentResults> read_files(const FitArguments& args) {
  if (args.files.size() > kMaxFiles)
    throw UsageError("RESULTS", "", fmt::format("at most {} files", kMaxFiles),
                     std::to_string(args.files.size()));
  std::vector<ExperimentResults> out;
  for (const std::string& file : args.files) {
    try {
      out.push_back(read_results(read_input_file(file, kMaxResultsBytes), file));
    } catch (const InputError& e) {
      if (!args.skip) throw;
      std::cerr << "left out: " << printable(e.what()) << '\n';
    }
  }
  return out;
}

std::optional<DesignKey> design_of(const std::string& path) {
  if (path.empty()) return std::nullopt;
  const std::string file =
      std::filesystem::is_directory(path) ? (std::filesystem::path(path) / "design.json").string() : path;
  return read_design(read_input_file(file, kMaxDesignFile), file);
}

int run_fit(const FitArguments& args) {
  for (const std::string& path : {args.profile, args.page})
    if (!path.empty()) check_output_file(path);  // not after the work
  FitOptions options;
  options.curve = args.curve == "line" ? FittedCurve::kLine : FittedCurve::kSigmoid;
  options.draws = args.draws, options.seed = args.seed;
  const ExperimentFit fit =
      fit_experiment(read_files(args), design_of(args.design), options, context_of(args.jobs));
  if (!args.page.empty()) write_output_file(args.page, text_bytes(fit_page(fit)));
  if (fit.found && !args.profile.empty()) write_output_file(args.profile, text_bytes(jnd_profile_json(fit)));
  std::cout << (args.json ? fit_json(fit) + "\n" : fit_text(fit));
  return fit.found ? kExitOk : kExitDifferent;
}

}  // namespace

void add_fit_experiment(Command& experiment) {
  auto [c, args] = experiment.add("fit", "Find the just noticeable difference in judges' results", run_fit);
  c.option("RESULTS", args.files, "Files that judges have saved, of one experiment").required();
  c.option("-o,--output", args.profile, "The JND profile to write, for texmesh compile --jnd-profile",
           "FILE");
  c.option("--page", args.page, "A page to write: curves as SVG, judges, verdicts", "HTML");
  c.option("--design", args.design,
           "The experiment's folder or its design.json: every answer is compared with it", "DIR");
  c.option(
       "--curve", args.curve,
       "sigmoid = logistic in the logarithm of the change, with lapses, of greatest likelihood (7.3.4). line = "
       "straight, of least squares, as Fig. 7.7; one threshold for all sizes",
       "KIND")
      .one_of_explained({"sigmoid", "line"})
      .shows_default();
  c.option("--draws", args.draws, "Draws of the bootstrap").integer_in(40, 20000).shows_default();
  c.option("--seed", args.seed, "Of the draws").shows_default();
  c.flag("--skip", args.skip, "Leave out files that cannot be read, and say which");
  add_jobs_and_json_options(c, args.jobs, args.json, "lab/schemas/experiment-fit.v1.schema.json");
  c.examples(
      "  texmesh-lab experiment fit results/*.json -o jnd-profile.json\n"
      "  texmesh-lab experiment fit results/*.json --design judges/ --page fit.html -o jnd-profile.json\n"
      "  texmesh compile bust.glb -o bust.texmesh --jnd-profile jnd-profile.json");
  c.notes(
      "The threshold is the change at which 75 % of the answers are right, half-way between guessing and seeing. Bounds "
      "hold 95 % of the draws: of judges where there are five or more, else of answers.\n"
      "Left out, with the numbers: judges with fewer than 20 answers or 4 catch trials, with nearly all answers on one "
      "side, with too few catch trials right, and files that repeat another's answers.\n"
      "With two or more displayed sizes the fit decides about distance: where the bounds of the exponent hold 0, the "
      "profile says 0 (the same at every distance, as printed), else the measured exponent.\n"
      "The same files and seed give the same output on every machine.\n"
      "Exit code: 0 the threshold was found, 4 it lies outside the levels (no profile is written), 1 when a file is of "
      "another experiment, was changed or cannot be read, or no judge is left, 2 usage.");
}

}  // namespace texmesh
