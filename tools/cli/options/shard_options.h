#pragma once
#include <map>
#include <string>

#include "pipeline/batch/fleet/shards.h"

namespace texmesh {

class Command;

/// --shard and --costs.
void add_shard_options(Command& command, std::string& shard, std::string& costs);
/// "" stands for the whole. Reads the environment. InputError, see read_shard().
Shard shard_option(const std::string& text);
/// What the summary of an earlier run says that models took. InputError for a file that is no summary.
std::map<std::string, double> costs_option(const std::string& file);

}  // namespace texmesh
