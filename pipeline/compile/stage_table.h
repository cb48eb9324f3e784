#pragma once
#include <vector>

#include "pipeline/graph/stage.h"

namespace texmesh {

struct CompileOptions;

/// The whole graph with these options, which must be resolved (resolve_options), in an order in which every
/// input stands before its use. stage_table.cpp is the one place where the graph can be read.
std::vector<Stage> stage_table(const CompileOptions& options);

/// The graph with default options: for those who ask for names, versions and inputs.
const std::vector<Stage>& default_stage_table();

/// The stages of stage_table() that `last` needs, directly or not, in the table's order, and `last` itself:
/// for commands that want to see what is in the middle of the graph.
std::vector<Stage> graph_towards(Stage last, const CompileOptions& options);

}  // namespace texmesh
