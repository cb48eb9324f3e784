#include <fmt/format.h>

#include <filesystem>
#include <iostream>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/batch/progress.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/resource_error.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/publish/report/collection/collection_page.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

struct MergeArguments {
  std::vector<std::string> files;
  std::string output, junit, html;
  int posters = 1000;
};

void write_text_file(const std::string& path, const std::string& text) {
  if (!path.empty()) write_output_file(path, text_bytes(text));
}

/// The page's pictures stand in a folder beside it: page.html, page-posters/00000.jpg.
void write_collection_page(const RunSummary& merged, const MergeArguments& args) {
  if (args.html.empty()) return;
  const fs::path folder = fs::path(args.html).parent_path();
  const std::string posters = fs::path(args.html).stem().string() + "-posters";
  const CollectionPage page = collection_page(merged, posters, static_cast<std::size_t>(args.posters),
                                              [](const ModelSummary& m) { return package_face(m.output); });
  std::error_code error;
  if (!page.files.empty()) fs::create_directories(folder / posters, error);
  if (error)
    throw ResourceError((folder / posters).string(), "", "a folder that can be made", error.message());
  for (const PageFile& file : page.files) write_file_atomically((folder / file.name).string(), file.bytes);
  write_text_file(args.html, page.html);
}

int run_merge(const MergeArguments& args) {
  for (const std::string* path : {&args.output, &args.junit, &args.html})
    if (!path->empty()) check_output_file(*path);
  std::vector<SummaryFile> files;
  for (const std::string& file : args.files) files.push_back(open_summary(file));
  const RunSummary merged = merge_summaries(std::move(files));
  write_text_file(args.output, write_summary(merged));
  if (!args.junit.empty()) write_text_file(args.junit, write_junit(merged));
  write_collection_page(merged, args);
  for (const SummaryProblem& p : merged.problems)
    std::cerr << "texmesh summary: " << p.kind << ": " << (p.file.empty() ? "" : p.file + ": ") << p.text
              << '\n';
  const SummaryCounts c = count_results(merged.models);
  std::cout << fmt::format("{} compiled, {} up to date, {} failed, {} cancelled in {} {}, {}\n", c.compiled,
                           c.unchanged, c.failed, c.cancelled, merged.parts.size(),
                           merged.parts.size() == 1 ? "run" : "runs", format_seconds(merged.seconds));
  return exit_code_of(merged);
}

}  // namespace

void add_summary_command(Command& app) {
  auto args = std::make_shared<MergeArguments>();
  Command c = app.add("summary");
  c.needs_command();
  Command merge = c.add("merge", "Merge what compile --summary wrote for each shard");
  merge.option("SUMMARY", args->files, "Files of compile --summary").required();
  merge.option("-o,--output", args->output, "Write the merged summary (schemas/summary.v1.schema.json)")
      .value_name("FILE");
  merge.option("--junit", args->junit, "Write every model's result as JUnit XML").value_name("FILE");
  merge
      .option("--html", args->html,
              "Write a page: what went wrong first, then figures, then the packages with their posters")
      .value_name("FILE");
  merge.option("--posters", args->posters, "Most posters on the page").integer_in(0, 100'000).shows_default();
  merge.examples("  texmesh summary merge report/*.json -o all.json --junit all.xml --html all.html");
  merge.notes(
      "Summaries that are half-written, foreign (of another collection) or double, and shards without one, are "
      "named.\n"
      "Exit code: as compile's for the models of all runs; 75 also where a shard is missing or half-written, 1 "
      "also where a summary is foreign.");
  merge.on_run([args] {
    try {
      return run_merge(*args);
    } catch (const InputError& e) {
      std::cerr << "texmesh summary: " << e.what() << '\n';
      return static_cast<int>(kExitUsage);
    }
  });
}

}  // namespace texmesh
