#pragma once
#include <string>

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

}  // namespace texmesh
