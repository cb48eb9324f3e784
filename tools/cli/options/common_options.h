#pragma once
#include <map>
#include <string>

#include "pipeline/batch/plan.h"

namespace texmesh {

class Command;
class Option;
struct RunContext;

// Options that several commands share.

/// --jobs; 0, the default, stands for every processor.
Option add_jobs_option(Command& command, int& jobs);
RunContext context_of(int jobs);

/// Where stages' results are kept: --cache and --no-cache, as compile understands them.
struct CacheChoice {
  std::string folder;
  bool off = false;
};
void add_cache_options(Command& command, CacheChoice& cache);

/// A package that the user names: a file, a folder or, where `urls`, a URL.
Option add_package_argument(Command& command, std::string& package, bool urls);

/// --shard and --costs.
void add_shard_options(Command& command, std::string& shard, std::string& costs);
/// "" stands for the whole. Reads the environment. InputError, see read_shard().
Shard shard_option(const std::string& text);
/// What the summary of an earlier run says that models took. InputError for a file that is no summary.
std::map<std::string, double> costs_option(const std::string& file);

}  // namespace texmesh
