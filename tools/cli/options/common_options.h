#pragma once
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <ostream>
#include <thread>

#include "format/base/note.h"
#include "pipeline/batch/fleet/shard.h"

namespace texmesh {

class Command;
class Option;
class Store;
struct CompileOptions;
struct RunContext;

// Options that several commands share.

/// UsageError where `output`, the name of a folder that is to be made, ends as the name of a file does, or
/// nearly as `or_file`, which it may have. A folder that is there, or a "/" at the end, has any name.
void check_folder_name(const std::string& output, const std::string& or_file = "");

/// --jobs; 0, the default, stands for every processor.
Option add_jobs_option(Command& command, int& jobs);
/// --jobs, and --json for one JSON object; `schema` names its schema, as "schemas/diff.v1.schema.json", or is
/// empty.
void add_jobs_and_json_options(Command& command, int& jobs, bool& json, const std::string& schema = {});
RunContext context_of(int jobs);

/// Where stages' results are kept: --cache and --no-cache, as compile understands them.
struct CacheChoice {
  std::string folder;
  bool off = false;
};
void add_cache_options(Command& command, CacheChoice& cache);
std::unique_ptr<Store> store_of(const CacheChoice& cache);

/// Options as a profile has them, which is a name or a JSON file; those of `options` for "".
void apply_profile(const std::string& profile, CompileOptions& options);

/// The warnings among the notes, a line each on standard error.
void print_warnings(const Notes& notes);

/// A package that the user names: a file, a folder or, where `urls`, a URL.
Option add_package_argument(Command& command, std::string& package, bool urls);

/// --shard and --costs.
void add_shard_options(Command& command, std::string& shard, std::string& costs);
/// "" stands for the whole. Reads the environment. InputError, see read_shard().
Shard shard_option(const std::string& text);
/// What the summary of an earlier run says that models took. InputError for a file that is no summary.
std::map<std::string, double> costs_option(const std::string& file);

/// "extract 40 %, 3 s left" on a line of a terminal that is drawn over, until the end takes it away; "report
/// 12 s" while nobody says how far the work is. Safe from several threads.
class PercentLine {
 public:
  /// On standard error, where that is a terminal.
  explicit PercentLine(std::string label);
  /// `patience`: the time until seconds are shown, and between them.
  PercentLine(std::string label, std::ostream& out, bool is_terminal,
              std::chrono::milliseconds patience = std::chrono::seconds(2));
  ~PercentLine() { end(); }
  PercentLine(const PercentLine&) = delete;
  PercentLine& operator=(const PercentLine&) = delete;
  /// 0..1; never goes back.
  void show(double fraction);
  void end();

 private:
  std::string label_;
  std::ostream& out_;
  bool is_terminal_;
  std::chrono::milliseconds patience_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  int percent_ = -1;
  bool drawn_ = false;
  std::condition_variable_any ended_;
  std::jthread clock_;
};

}  // namespace texmesh
