#include "tools/cli/options/shard_options.h"

#include <cstdlib>

#include "format/base/errors.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/io/file_resolver.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

void add_shard_options(Command& c, std::string& shard, std::string& costs) {
  c.option("--shard", shard,
           "Compile only part I of 0 .. N-1, balanced by cost. auto, auto/N = this array task's part")
      .value_name("I/N");
  c.option(
       "--costs", costs,
       "Summary of an earlier run: shards are balanced by what models took then (default: by the sizes of "
       "their files). Every shard needs the same")
      .value_name("FILE")
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

}  // namespace texmesh
