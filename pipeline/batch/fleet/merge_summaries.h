#pragma once
#include <optional>
#include <string>
#include <vector>

#include "pipeline/batch/fleet/run_summary.h"

namespace texmesh {

/// A summary's file as it was found.
struct SummaryFile {
  std::string file;
  std::optional<RunSummary> summary;  // nothing: `kind` and `text` say why
  std::string kind, text;             // half-written or foreign
};

/// Reads a summary; what cannot be used says so, nothing throws.
SummaryFile open_summary(const std::string& file);

/// One summary of many: every package once, by package. A package in several summaries keeps its best result
/// (compiled, up to date, failed, not reached). `problems` names
///   half-written  a file that is not there, ends too early or is no JSON: its shard is to be run again
///   foreign       another document, or a shard of another collection than most of the files': not merged
///   double        a file that reports packages which an earlier file reports, too
///   missing       shards that no file reports
/// Equal files in equal order give equal bytes.
RunSummary merge_summaries(std::vector<SummaryFile> files);

/// Of a merged summary: that of its models, and kExitTryAgain where something is half-written or missing,
/// kExitModelFailed where something is foreign.
int exit_code_of(const RunSummary& merged);

}  // namespace texmesh
