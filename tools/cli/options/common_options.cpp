#include "tools/cli/options/common_options.h"

#include <sys/ioctl.h>

#include <cstdlib>
#include <sstream>

#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/options.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/machine.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

namespace {

/// What was printed must have arrived, or scripts take a part for the whole.
int with_all_printed(int exit_code) {
  std::cout.flush();
  if (std::cout) return exit_code;
  std::cerr << "texmesh: standard output cannot be written (is the disk full?)\n";
  return exit_code == kExitOk ? kExitModelFailed : exit_code;
}

/// Names of files may hold what a terminal takes for commands.
int fail_with(const std::string& what, int exit_code) {
  std::istringstream lines(what);
  std::string text;
  for (std::string line; std::getline(lines, line); text += printable(line) + '\n')
    if (text.empty()) text = "texmesh: ";
  std::cerr << text;
  return exit_code;
}

/// Broken at blanks where it is wider than `width`; what follows stands `indent` to the right. A word that is
/// wider stays whole.
std::string broken_line(std::string line, std::size_t indent, std::size_t width) {
  for (std::size_t begin = 0; begin + width < line.size();) {
    std::size_t blank = line.rfind(' ', begin + width);
    if (blank == std::string::npos || blank <= begin + indent) blank = line.find(' ', begin + width);
    if (blank == std::string::npos) break;
    line.replace(blank, 1, "\n" + std::string(indent, ' '));
    begin = blank + 1;
  }
  return line + "\n";
}

/// What follows stands beneath the last column, or item.
std::string broken_row(const std::string& line, std::size_t width) {
  if (line.find_first_not_of(" -") == std::string::npos) return line.substr(0, width) + "\n";  // of a heading
  const std::size_t gap = line.rfind("  ");
  const std::size_t indent = gap != std::string::npos ? gap + 2 : line.starts_with("- ") ? 2 : 0;
  return broken_line(line, indent > width / 2 ? 4 : indent, width);
}

}  // namespace

std::size_t help_width() {
  constexpr int kLeast = 60, kMost = 100;
  const char* columns = std::getenv("COLUMNS");
  int width = columns != nullptr ? std::atoi(columns) : 0;
  if (winsize window{}; width <= 0 && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0) width = window.ws_col;
  return static_cast<std::size_t>(std::clamp(width > 0 ? width : kMost, kLeast, kMost));
}

std::string wrapped_text(const std::string& text, std::size_t column, std::size_t indent) {
  return broken_line(std::string(column, ' ') + text, indent, help_width()).substr(column);
}

std::string wrapped_lines(const std::string& text, std::size_t width) {
  std::istringstream lines(text);
  std::string out;
  for (std::string line; std::getline(lines, line);) out += broken_row(line, width);
  return out;
}

std::string for_terminal(const std::string& text) {
  return ::isatty(STDOUT_FILENO) == 1 ? wrapped_lines(text, help_width()) : text;
}

int run_and_print_errors(const std::function<int()>& run) {
  try {
    return with_all_printed(run());
  } catch (const UsageError& e) {
    return fail_with(e.what(), kExitUsage);
  } catch (const Error& e) {
    return fail_with(e.what(), kExitModelFailed);
  } catch (const std::filesystem::filesystem_error& e) {
    return fail_with(e.what(), kExitModelFailed);
  } catch (const std::exception& e) {
    return fail_with(std::string("internal error: ") + e.what(), kExitInternal);
  }
}

void check_folder_name(const std::string& output, const std::string& or_file) {
  static constexpr std::string_view kFiles[] = {".texmesh", ".glb",  ".gltf", ".obj",  ".ply", ".stl",
                                                ".fbx",     ".usdz", ".zip",  ".tar",  ".gz",  ".7z",
                                                ".json",    ".html", ".htm",  ".jpeg", ".jpg", ".png"};
  const std::string ending = lower_ending(output);
  const bool is_file = !or_file.empty() && output.ends_with(or_file);
  if (output.ends_with("/") || is_file || std::filesystem::is_directory(output)) return;
  const bool nearly = ending.size() > 4 && closest_word(ending, kFiles) == kFiles[0];
  if (nearly || std::ranges::find(kFiles, ending) != std::end(kFiles))
    throw UsageError(
        "--output", "",
        (or_file.empty() ? "the name of a folder" : "NAME" + or_file + ", or the name of a folder") +
            std::string(" (with / at the end it may have any name)"),
        output);
}

Option add_jobs_option(Command& c, int& jobs) {
  return c.option("-j,--jobs", jobs, "Processors to use; 0 = all (default)").integer_in(0, 1024);
}

void add_jobs_and_json_options(Command& c, int& jobs, bool& json, const std::string& schema) {
  add_jobs_option(c, jobs);
  c.flag("--json", json, "Print one JSON object" + (schema.empty() ? "" : " (" + schema + ")"));
}

RunContext context_of(int jobs) {
  RunContext context;
  context.threads = jobs > 0 ? jobs : machine_share().processors;
  return context;
}

void add_cache_options(Command& c, CacheChoice& cache) {
  c.option("--cache", cache.folder,
           "Cache folder (default: TEXMESH_CACHE, else the user's cache folder). A folder that cannot be "
           "made or written costs a warning, never the build",
           "DIR");
  c.flag("--no-cache", cache.off, "Compute everything and keep nothing");
}

std::unique_ptr<Store> store_of(const CacheChoice& cache) {
  if (cache.off) return std::make_unique<NullStore>();
  return open_disk_store(default_cache_folder(cache.folder));
}

void apply_profile(const std::string& profile, CompileOptions& options) {
  if (profile.empty()) return;
  const std::string file = profile_file(profile);
  const auto bytes = read_input_file(file, 1 << 20);
  read_profile(options, std::string(bytes.begin(), bytes.end()), file);
}

void print_warnings(const Notes& notes) {
  for (const Note& n : notes)
    if (n.severity == Severity::kWarning)
      std::cerr << "warning: " << n.code << printable((n.place.empty() ? "" : ": " + n.place) + ": " + n.text)
                << '\n';
}

Option add_package_argument(Command& c, std::string& package, bool urls) {
  return c
      .option("PACKAGE", package,
              urls ? "A .texmesh file, a folder that unpack made, or an http(s) URL"
                   : "A .texmesh file, or a folder that unpack made")
      .required();
}

void add_shard_options(Command& c, std::string& shard, std::string& costs) {
  c.option("--shard", shard,
           "Compile only part I of 0 .. N-1, balanced by cost. auto, auto/N = this array task's part", "I/N");
  c.option(
       "--costs", costs,
       "Summary of an earlier run: shards are balanced by what models took then (default: by the sizes of "
       "their files). Every shard needs the same",
       "FILE")
      .rare();
}

Shard shard_option(const std::string& text) {
  if (text.empty()) return {};
  return read_shard(text, [](const char* name) -> const char* { return std::getenv(name); });
}

std::map<std::string, double> costs_option(const std::string& file) {
  if (file.empty()) return {};
  try {
    return recorded_costs_s(read_summary(read_input_file(file, 1ull << 32), file));
  } catch (const FormatError& e) {
    throw InputError(e.file(), e.place(), e.expected(), e.found());
  }
}

PercentLine::PercentLine(std::string label)
    : PercentLine(std::move(label), std::cerr, ::isatty(STDERR_FILENO) == 1) {}

PercentLine::PercentLine(std::string label, std::ostream& out, bool is_terminal,
                         std::chrono::milliseconds patience)
    : label_(std::move(label)), out_(out), is_terminal_(is_terminal), patience_(patience) {
  if (!is_terminal) return;
  clock_ = std::jthread([this, patience](std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (!ended_.wait_for(lock, stop, patience, [&] { return stop.stop_requested(); })) {
      if (percent_ >= 0) return;
      const auto taken = std::chrono::steady_clock::now() - start_;
      out_ << "\r\033[K" << label_ << ' ' << std::chrono::duration_cast<std::chrono::seconds>(taken).count()
           << " s" << std::flush;
      drawn_ = true;
    }
  });
}

void PercentLine::show(double fraction) {
  const int percent = static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0));
  const std::lock_guard lock(mutex_);
  if (!is_terminal_ || percent <= percent_) return;
  percent_ = percent;
  drawn_ = true;
  out_ << "\r\033[K" << label_ << ' ' << percent << " %";
  // What is left takes as long a part as what was done has taken.
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start_;
  if (taken >= patience_ && percent > 0)
    out_ << ", " << static_cast<int>(std::ceil(taken.count() * (100 - percent) / percent)) << " s left";
  out_ << std::flush;
}

void PercentLine::end() {
  clock_ = {};
  const std::lock_guard lock(mutex_);
  if (drawn_) out_ << "\r\033[K" << std::flush;
  drawn_ = is_terminal_ = false;
}

}  // namespace texmesh
