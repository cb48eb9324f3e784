// texmesh-lab experiment make: a page of forced choices between two alternatives.
#include <fmt/format.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "lab/cli/commands.h"
#include "lab/experiment/make_experiment.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMaxConsentBytes = 20000;
constexpr std::size_t kLeastLevels = 3, kMaxTitle = 200, kMaxUrl = 500;
constexpr double kLeastSizePx = 16, kMostSizePx = 2048, kMostShapeLevel = 0.4;

constexpr const char* kConsent =
    "You take part in an experiment about seeing. It shows pictures of objects and asks which of them look "
    "alike. It does no harm; who gets tired may stop at any time by closing the page.\n\n"
    "Kept are: your choices and how long each took, the size and the pixels of your screen, the day, and the name "
    "that you enter. All of it stays in this browser until you save it as a file or send it yourself at the end.";

struct MakeArguments {
  std::string package, folder, stimuli, title, consent, post;
  std::vector<std::string> sizes, levels;
  ExperimentOptions options;
  int jobs = 0;
  bool json = false;
};

/// Numbers that rise. UsageError that names the flag.
std::vector<double> parse_numbers(const std::vector<std::string>& texts, const std::string& flag,
                                  double least, double most) {
  std::vector<double> out;
  for (const std::string& text : texts) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= least && value <= most))
      throw UsageError(flag, "", fmt::format("a number from {:g} to {:g}", least, most), printable(text));
    if (!out.empty() && value <= out.back())
      throw UsageError(flag, "", "numbers that rise",
                       printable(text) + fmt::format(" after {:g}", out.back()));
    out.push_back(value);
  }
  return out;
}

StimulusKind kind_of(const MakeArguments& args) {
  if (args.package.empty() && args.stimuli.empty())
    throw UsageError("--stimuli", "", "ellipsoids, quadrics, or a package whose scales are compared",
                     "neither");
  if (args.stimuli == "mesh" && args.package.empty())
    throw UsageError("PKG", "", "a package whose scales are compared, with --stimuli mesh", "none");
  if (!args.package.empty() && args.stimuli != "mesh" && !args.stimuli.empty())
    throw UsageError("--stimuli", "", "mesh with a package", args.stimuli);
  return args.stimuli == "ellipsoids" ? StimulusKind::kEllipsoids
         : args.stimuli == "quadrics" ? StimulusKind::kQuadrics
                                      : StimulusKind::kMesh;
}

/// Ranges in which thresholds of 0.04 and 0.10 (7.3.2, 7.3.3) lie in the middle.
std::vector<double> levels_of(const MakeArguments& args, StimulusKind kind) {
  if (kind == StimulusKind::kMesh) {
    if (!args.levels.empty())
      throw UsageError("--levels", "", "none with a package: its scales are the levels", args.levels.front());
    return {};
  }
  if (args.levels.empty())
    return kind == StimulusKind::kEllipsoids ? std::vector<double>{.01, .02, .03, .04, .06, .08, .11, .15}
                                             : std::vector<double>{.02, .04, .06, .08, .11, .15, .2, .27};
  const std::vector<double> levels = parse_numbers(args.levels, "--levels", kLeastLevel, kMostShapeLevel);
  if (levels.size() < kLeastLevels || levels.size() > kMostLevels)
    throw UsageError("--levels", "", fmt::format("{} to {} numbers", kLeastLevels, kMostLevels),
                     std::to_string(levels.size()));
  return levels;
}

void check_post_url(const std::string& url) {
  if (url.empty()) return;
  constexpr std::string_view kAllowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._~:/?#[]@!$&()*+=%";
  const bool absolute = url.starts_with("https://") || url.starts_with("http://");
  const bool relative = (url.starts_with("/") && !url.starts_with("//")) || url.starts_with("./");
  const bool has_host = !absolute || url.find_first_not_of('/', url.find("://") + 3) == url.find("://") + 3;
  if ((!absolute && !relative) || !has_host || url.size() > kMaxUrl ||
      url.find_first_not_of(kAllowed) != std::string::npos || url.find('@') != std::string::npos)
    throw UsageError("--post", "",
                     "an address that begins with https://, http://, / or ./, without a user's name",
                     printable(url.substr(0, 100)));
}

/// UTF-8 without control characters but for line ends and tabs.
bool is_plain_text(std::string text) {
  for (char& c : text)
    if (c == '\n' || c == '\r' || c == '\t') c = ' ';
  return clean_text(text, text.size()) == text;
}

std::string text_of(const std::string& file) {
  const std::vector<std::uint8_t> bytes = read_input_file(file, kMaxConsentBytes);
  const std::string text(bytes.begin(), bytes.end());
  if (!is_plain_text(text) || text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw InputError(file, "", "a text in UTF-8", text.empty() ? "nothing" : "something else");
  return text;
}

ExperimentOptions experiment_options(const MakeArguments& args) {
  ExperimentOptions options = args.options;
  options.kind = kind_of(args);
  options.levels = levels_of(args, options.kind);
  if (!args.sizes.empty()) options.sizes_px = parse_numbers(args.sizes, "--sizes", kLeastSizePx, kMostSizePx);
  if (options.sizes_px.size() > kMostSizes)
    throw UsageError("--sizes", "", fmt::format("at most {} sizes", kMostSizes),
                     std::to_string(options.sizes_px.size()));
  if (options.move && options.sizes_px.size() > 1)
    throw UsageError("--sizes", "", "one size with --move: the nearest",
                     std::to_string(options.sizes_px.size()));
  if (args.title.size() > kMaxTitle || !is_plain_text(args.title))
    throw UsageError("--title", "", fmt::format("at most {} bytes of UTF-8", kMaxTitle), "another text");
  options.title = !args.title.empty() ? args.title
                  : options.move      ? "Where do both look alike?"
                                      : "Which one is the same?";
  options.consent = args.consent.empty() ? kConsent : text_of(args.consent);
  check_post_url(args.post);
  options.post_url = args.post;
  const std::size_t levels = options.kind == StimulusKind::kMesh ? 10 : options.levels.size();
  const std::size_t trials = options.sizes_px.size() * (levels * static_cast<std::size_t>(options.repeats) +
                                                        static_cast<std::size_t>(options.catches));
  if (trials > kMostTrials)
    throw UsageError("--repeats", "", fmt::format("at most {} trials", kMostTrials), std::to_string(trials));
  return options;
}

void print_experiment(const MakeArguments& args, const Experiment& experiment) {
  const ExperimentDesign& d = experiment.design;
  std::uint64_t bytes = 0;
  for (const ExperimentFile& f : experiment.files) bytes += f.bytes.size();
  if (args.json) {
    Json sizes = Json::array();
    for (const ExperimentCondition& c : d.conditions)
      sizes.push_back({{"displayed_px", c.displayed_px}, {"frame_px", c.frame_px}});
    const Json out{
        {"design", d.id},     {"kind", name_of(d.options.kind)}, {"trials", d.trials.size()},
        {"levels", d.levels}, {"conditions", std::move(sizes)},  {"files", experiment.files.size()},
        {"bytes", bytes}};
    std::cout << out.dump() << '\n';
    return;
  }
  std::string levels;
  for (const double l : d.levels) levels += fmt::format("{}{:g}", levels.empty() ? "" : ", ", l);
  std::cout << fmt::format("experiment {}: {} trials for each judge, changes of {}\n", d.id, d.trials.size(),
                           levels);
  for (const ExperimentCondition& c : d.conditions)
    std::cout << fmt::format("  {:g} px displayed in pictures of {} px\n", c.displayed_px, c.frame_px);
  std::cout << fmt::format("{} files, {} kB; serve the folder and open {}\n", experiment.files.size(),
                           kilobytes(bytes), (std::filesystem::path(args.folder) / "index.html").string());
}

int run_make(const MakeArguments& args) {
  const ExperimentOptions options = experiment_options(args);
  check_experiment_folder(args.folder);  // not after the work
  const RunContext context = context_of(args.jobs);
  std::optional<PackageReader> package;
  if (options.kind == StimulusKind::kMesh) package.emplace(open_store(args.package));
  const StimulusSet stimuli = package ? package_stimuli(*package, context) : shape_stimuli(options);
  const Experiment experiment = make_experiment(options, stimuli, context);
  write_experiment(experiment, args.folder);
  print_experiment(args, experiment);
  return kExitOk;
}

void add_stimulus_options(Command& c, MakeArguments& args) {
  c.option("PKG", args.package, "A package: its scales are compared with S_0 (thesis 7.3.4)");
  c.option("-o,--output", args.folder,
           "The folder to make, with index.html in it. A folder with files is refused", "DIR")
      .required();
  c.option(
       "--stimuli", args.stimuli,
       "ellipsoids = drawn ones, of which one to three axes change (7.3.2). quadrics = irregular ones, of which "
       "the depth changes (7.3.3). mesh = the scales of PKG",
       "KIND")
      .one_of_explained({"ellipsoids", "quadrics", "mesh"});
  c.option(
       "--sizes", args.sizes,
       "Displayed sizes of the object in px, with commas between (default: 160). Two or more make the experiment "
       "on distance (6.2): fit says whether what is just noticeable depends on the size",
       "PX,..")
      .separated_by(',');
  c.option(
       "--levels", args.levels,
       "Relative changes, with commas between. Default: 0.01 to 0.15 for ellipsoids, 0.02 to 0.27 for quadrics",
       "X,..")
      .separated_by(',');
  c.flag(
      "--move", args.options.move,
      "Judges move the changed object, of 21 places to 1/16 of the size, until it looks like the unchanged one "
      "(6.2), without a time limit; where it looks alike, fit finds for each change");
  c.option("--objects", args.options.objects, "How many ellipsoids or quadrics")
      .integer_in(1, kMostObjects)
      .shows_default();
  c.option("--views", args.options.views, "Directions around the object that judges turn through")
      .integer_in(1, 24)
      .shows_default();
}

void add_trial_options(Command& c, MakeArguments& args) {
  c.option("--repeats", args.options.repeats,
           "Trials of each level and size, half with the right one on either side")
      .integer_in(1, kMostRepeats)
      .shows_default();
  c.option(
       "--catches", args.options.catches,
       "Catch trials of each size: a change of 45 %, which tells judges who do not look. fit wants 4 or more")
      .integer_in(0, kMostCatches)
      .shows_default();
  c.option("--time-limit", args.options.time_limit_s,
           "Seconds after which nothing turns and the judge has to choose")
      .number_in(0.1, 600)
      .shows_default();
  c.option("--pause", args.options.pause_s, "Seconds without a picture between trials")
      .number_in(0, 10)
      .shows_default();
  c.option(
       "--pixels-per-degree", args.options.pixels_per_degree,
       "Pixels of the picture in a degree at the judge's eye; the page says how far to sit. 40 = an ordinary "
       "display at 60 cm")
      .number_in(5, 200)
      .shows_default();
  c.option("--seed", args.options.seed, "Of objects, orders and names of files").shows_default();
  c.option("--title", args.title, "Heading of the page");
  c.option("--consent", args.consent, "File with the text that judges agree to, in place of the page's own",
           "FILE");
  c.option("--post", args.post, "Address to which judges may send their results at the end, as JSON by POST",
           "URL");
  add_jobs_option(c, args.jobs);
  c.flag("--json", args.json, "Print id, levels, sizes and trials as one JSON object");
}

}  // namespace

void add_make_experiment(Command& experiment) {
  auto [c, args] =
      experiment.add("make", "Write a page of forced choices between two alternatives", run_make);
  add_stimulus_options(c, args);
  add_trial_options(c, args);
  c.examples(
      "  texmesh-lab experiment make --stimuli quadrics -o judges/\n"
      "  texmesh-lab experiment make --stimuli quadrics --sizes 64,128,256 -o distance/\n"
      "  texmesh-lab experiment make bust.texmesh --sizes 96,192 -o bust-judges/ --post https://example.org/results\n"
      "  texmesh-lab experiment make bust.texmesh --move --sizes 320 -o bust-moves/\n"
      "  cd judges && python3 -m http.server      and open http://localhost:8000/");
  c.notes(
      "A judge sees a reference on top and two alternatives beneath it, one unchanged and one changed, and chooses the "
      "one that is the same. The page measures the screen with a bank card, says how far to sit, shows pictures without "
      "resampling, asks in a balanced drawn order, and keeps the answers in the browser. At the end the judge saves them "
      "as a file for texmesh-lab experiment fit. The page asks no other server for anything.\n"
      "With --move an object stays and the judge moves the changed one beside it. Catch trials are an unchanged object, "
      "which nobody has to move away.\n"
      "30 answers a level or more make a threshold (5.6): with 6 repeats that is five judges.\n"
      "Names and sizes of the pictures tell nothing; design.json tells all, so judges must not read it.\n"
      "The same options give the same files on every machine.\n"
      "Exit code: 0, 1 when the package cannot be read or DIR not be written, 2 usage.");
}

}  // namespace texmesh
