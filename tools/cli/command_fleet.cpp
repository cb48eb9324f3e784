// What serves builds of large collections on many machines: the list of models, and one summary of many runs.
#include <fmt/format.h>

#include <filesystem>

#include "format/base/text_bytes.h"
#include "pipeline/batch/fleet/model_list.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/batch/progress.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/resolver.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/publish/report/collection/collection_page.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

struct ListArguments {
  std::vector<std::string> inputs;
  std::string output, costs;
  int shards = 1;
  bool json = false;
};

int run_list(const ListArguments& args) {
  PlanRequest request;
  request.inputs = args.inputs;
  request.output = args.output;
  request.costs_s = costs_option(args.costs);
  const ModelList list = list_collection(request, args.shards);
  if (args.json) {
    std::cout << write_model_list(list);
    return kExitOk;
  }
  for (const ListedModel& m : list.models) {
    std::cout << m.input << " -> " << m.output << "  " << format_bytes(m.bytes);
    if (args.shards > 1) std::cout << "  shard " << m.shard;
    std::cout << '\n';
  }
  return kExitOk;
}

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

void add_list_command(Command& app) {
  auto args = std::make_shared<ListArguments>();
  Command c = app.add("list", "List the models of a collection with their packages and files");
  c.option("INPUT", args->inputs, "Models, folders of models, or collections (.json), as compile takes them")
      .required();
  c.option("-o,--output", args->output, "Where the packages would go, as compile takes it")
      .required()
      .value_name("OUTPUT");
  c.option("--shards", args->shards, "Say of every model which of so many shards compile --shard gives it to")
      .integer_in(1, 1'000'000);
  c.option("--costs", args->costs, "As for compile --shard").value_name("FILE");
  c.flag("--json", args->json, "Print JSON (schemas/list.v1.schema.json)");
  c.examples(
      "  texmesh list scans/ -o packages/                      what compile would make\n"
      "  texmesh list scans/ -o packages/ --shards 40 --json   for another engine");
  c.notes(
      "list tells Snakemake (examples/snakemake), Nextflow or make the names of packages, the files that each "
      "model names, and sizes. It compiles nothing and opens no picture.");
  c.on_run([args] { return as_usage([&] { return run_list(*args); }); });
}

void add_summary_command(Command& app) {
  auto args = std::make_shared<MergeArguments>();
  Command c = app.add("summary", "Merge the reports of many runs of compile into one");
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
      "merge names summaries that are half-written, foreign (of another collection) or double, and shards "
      "without a summary.\n"
      "Exit code: as compile's for the models of all runs; 75 also where a shard is missing or half-written, 1 "
      "also where a summary is foreign.");
  merge.on_run([args] { return as_usage([&] { return run_merge(*args); }); });
}

}  // namespace texmesh
