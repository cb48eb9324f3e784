#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <thread>

#include "format/base/errors.h"
#include "pipeline/batch/plan.h"
#include "pipeline/batch/run.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/units.h"
#include "pipeline/compile/jnd_profile.h"
#include "pipeline/compile/option_fields.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/profile.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/file_resolver.h"

namespace texmesh {
namespace {

/// Shorter names of options that people type often.
const std::map<std::string, std::string> kShortNames{{"ladder.rungs", "--rungs"},
                                                     {"ladder.subsampling", "--subsampling"},
                                                     {"ladder.mode", "--ladder"},
                                                     {"scales.mesh_codec", "--mesh-codec"},
                                                     {"fragmentation.fill", "--fill"},
                                                     {"lut.allocate", "--allocate"},
                                                     {"perceptual_values.jnd", "--jnd"},
                                                     {"simplification.order", "--order"},
                                                     {"package.title", "--title"},
                                                     {"import.up", "--up"},
                                                     {"ladder.lossless_top", "--lossless-top"}};

struct CompileArguments {
  std::vector<std::string> inputs, layers;
  std::string output, profile, jnd_profile, cache, memory, model_memory = "8GiB", shard;
  std::string cache_size = "20GB", cache_age = "90d";
  int jobs = 0;
  bool no_cache = false, json = false, quiet = false, keep_going = false;
  RunSettings run;
  std::map<std::string, std::string> options;  // path -> text
};

std::string help_of(const OptionField& f) {
  std::string help = f.help;
  if (f.range)
    help += " [" + CLI::detail::to_string(f.range->lo) + " .. " + CLI::detail::to_string(f.range->hi) + "]";
  if (const auto* e = std::get_if<EnumField>(&f.value)) {
    help += " {";
    for (std::size_t i = 0; i < e->names.size(); ++i) help += (i ? "|" : "") + std::string(e->names[i]);
    help += "}";
  }
  return help + " (default " + option_text(f) + ")";
}

void add_stage_options(CLI::App& app, CompileArguments& args) {
  CompileOptions defaults;
  for (const OptionField& f : list_options(defaults)) {
    std::string names = "--" + f.path();
    const auto it = kShortNames.find(f.path());
    if (it != kShortNames.end() &&
        std::holds_alternative<bool*>(f.value))  // a flag, and the long one with a value
      app.add_flag_callback(
             it->second, [&args, path = f.path()] { args.options[path] = "true"; }, f.help)
          ->group("Stage " + f.stage);
    else if (it != kShortNames.end())
      names += "," + it->second;
    app.add_option_function<std::string>(
           names, [&args, path = f.path()](const std::string& v) { args.options[path] = v; }, help_of(f))
        ->group("Stage " + f.stage)
        ->type_name("");
  }
}

/// Defaults, the profile, then the JND profile over it.
CompileOptions base_options(const CompileArguments& args) {
  CompileOptions options;
  if (!args.profile.empty()) {
    const auto bytes = read_input_file(args.profile, 1 << 20);
    read_profile(options, std::string(bytes.begin(), bytes.end()), args.profile);
  }
  if (!args.jnd_profile.empty())
    read_jnd_profile(options, read_input_file(args.jnd_profile, 1 << 16), args.jnd_profile);
  return options;
}

/// Flags win over everything that a file says.
void apply_flags(const CompileArguments& args, CompileOptions& options) {
  std::vector<OptionField> fields = list_options(options);
  for (const auto& [path, text] : args.options) set_option(*find_option(fields, path), text, "--" + path);
  check_options(options, "command line");
}

OutputMode output_mode(const CompileArguments& args) {
  if (args.json) return OutputMode::kJson;
  if (args.quiet) return OutputMode::kQuiet;
  return ::isatty(STDOUT_FILENO) ? OutputMode::kTerminal : OutputMode::kPlain;
}

/// "2/8" -> 2 of 0 .. 7.
void read_shard(const std::string& text, PlanRequest& request) {
  if (text.empty()) return;
  int shard = -1, shards = 0, read = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard, &shards, &read) != 2 ||
      read != static_cast<int>(text.size()) || shards < 1 || shards > 1'000'000 || shard < 0 ||
      shard >= shards)
    throw InputError("--shard", "", "I/N with I in 0 .. N - 1", text);
  request.shard = shard;
  request.shards = shards;
}

/// Four fifths of the machine's memory, unless the user says what there is to use.
std::uint64_t memory_to_use(const std::string& text) {
  if (!text.empty()) return parse_bytes(text, "--memory");
  const long pages = ::sysconf(_SC_PHYS_PAGES), page_bytes = ::sysconf(_SC_PAGE_SIZE);
  return pages > 0 && page_bytes > 0
             ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page_bytes) / 5 * 4
             : 0;
}

PlanRequest plan_request(const CompileArguments& args) {
  PlanRequest request;
  request.inputs = args.inputs;
  request.output = args.output;
  request.base = std::make_shared<const CompileOptions>(base_options(args));
  request.apply_flags = [&args](CompileOptions& options) { apply_flags(args, options); };
  CompileOptions check = *request.base;  // wrong flags are an error even where there is nothing to compile
  apply_flags(args, check);
  read_shard(args.shard, request);
  return request;
}

RunSettings run_settings(const CompileArguments& args) {
  RunSettings run = args.run;
  run.pool.processors =
      std::max(1, args.jobs > 0 ? args.jobs : static_cast<int>(std::thread::hardware_concurrency()));
  run.pool.memory_bytes = memory_to_use(args.memory);
  run.pool.limits.memory_bytes = parse_bytes(args.model_memory, "--model-memory");
  if (!args.no_cache) run.cache.folder = default_cache_folder(args.cache);
  run.cache.layers = args.layers;
  for (std::string& layer : layers_from_environment()) run.cache.layers.push_back(std::move(layer));
  for (const std::string& layer : run.cache.layers) check_layer(layer);
  run.cache_limits = {parse_bytes(args.cache_size, "--cache-size"),
                      parse_seconds(args.cache_age, "--cache-age")};
  run.mode = output_mode(args);
  for (const std::string& file : {args.profile, args.jnd_profile})
    if (!file.empty()) run.more_inputs.push_back(file);
  return run;
}

void add_run_options(CLI::App& c, CompileArguments& args) {
  RunSettings& run = args.run;
  c.add_option("-j,--jobs", args.jobs, "Processors to use (default: all)")->check(CLI::Range(1, 1024));
  c.add_option("--memory", args.memory,
               "Most memory of all models that run side by side, by what they took before (default: 4/5 of "
               "the machine's); one that needs more alone runs alone, see --model-memory");
  c.add_option("--model-memory", args.model_memory, "Most memory (address space) of one model's process")
      ->capture_default_str();
  c.add_option("--timeout", run.pool.limits.wall_s, "Most seconds for one model, 0 = no limit")
      ->capture_default_str();
  c.add_option("--cpu-limit", run.pool.limits.cpu_s, "Most processor seconds for one model, 0 = no limit")
      ->capture_default_str();
  c.add_option("--shard", args.shard,
               "I/N: compile only part I of 0 .. N-1; which models that are does not change when "
               "others come and go");
  auto* keep_going =
      c.add_flag("--keep-going", args.keep_going, "Compile the other models after a failure (default)");
  c.add_flag("--fail-fast", run.pool.stop_on_failure, "Start no further model after a failure")
      ->excludes(keep_going);
  c.add_flag("--retry-failed", run.retry_failed,
             "Try models again that failed before, though nothing has changed since");
  c.add_flag("--strict", run.strict, "Warnings are errors");
}

void add_cache_options(CLI::App& c, CompileArguments& args) {
  c.add_option("--cache", args.cache,
               "Cache folder (default: TEXMESH_CACHE, else the user's cache folder); one that "
               "cannot be made or written costs a warning, never the build");
  c.add_flag("--no-cache", args.no_cache, "Compute everything, keep nothing");
  c.add_option("--cache-layer", args.layers,
               "Folder or http(s) URL to ask behind the cache folder; may be given several times (also "
               "TEXMESH_CACHE_LAYERS, separated by blanks)");
  c.add_flag("--cache-upload", args.run.cache.upload, "Put what is computed into the layers that are URLs");
  c.add_option("--cache-size", args.cache_size, "The cache folder is pruned to this size, 0 = no limit")
      ->capture_default_str();
  c.add_option("--cache-age", args.cache_age, "Results unused for this long are pruned, 0 = never")
      ->capture_default_str();
}

void add_report_options(CLI::App& c, CompileArguments& args) {
  RunSettings& run = args.run;
  c.add_flag("-n,--dry-run", run.dry_run, "Say what would run and why; write nothing");
  c.add_flag("--explain", run.explain, "Say of every stage whether it runs, and what has changed");
  c.add_flag("--stats", run.statistics, "A table of stages at the end: runs, cache hits, seconds");
  c.add_option("--depfile", run.depfile, "Dependencies of the package, for make and ninja (one model only)");
  c.add_option("--summary", run.summary, "JSON file: every model's result (schemas/summary.v1.schema.json)");
  c.add_option("--junit", run.junit, "The same as JUnit XML");
  c.add_option("--trace", run.trace, "JSON file for chrome://tracing or Perfetto: what ran when");
  c.add_flag("--json", args.json, "One JSON event a line (schemas/event.v1.schema.json)");
  c.add_flag("-q,--quiet", args.quiet, "Only warnings and errors");
  c.add_flag("-v,--verbose", run.verbose, "Every stage and note");
}

constexpr const char* kFooter =
    "Examples:\n"
    "  texmesh compile turtle.glb -o turtle.texmesh\n"
    "  texmesh compile scans/ -o packages/ --jobs 8 --cache /var/cache/texmesh\n"
    "  texmesh compile collection.json -o packages/ --junit report.xml\n"
    "  texmesh compile scans/ -o packages/ --dry-run            what would run, and why\n"
    "  texmesh compile scans/ -o packages/ --shard $TASK/40     one of 40 machines' part\n"
    "  texmesh compile bust.obj -o bust.texmesh --profile museum.json --rungs 8,18,53,86\n\n"
    "Every stage option can stand in a profile under the same name: "
    "{\"version\":1,\"ladder\":{\"rungs\":[8,18,53,86]}}.\n"
    "A package is made again only when its model, a file that the model refers to, an option or texmesh has "
    "changed.\n"
    "Exit code: 0 all well, 1 some model failed, 2 usage, 3 internal error. A model that fails leaves the "
    "package that was there before.";

}  // namespace

void add_compile_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<CompileArguments>();
  CLI::App* c = app.add_subcommand("compile", "Compile textured scans into packages");
  c->add_option(
       "INPUT", args->inputs,
       "Models (.glb .gltf .obj .ply .stl, range-scan .json), folders of them, or collections (.json)")
      ->required();
  c->add_option("-o,--output", args->output, "NAME.texmesh for one model, a folder for several")->required();
  c->add_option("--profile", args->profile,
                "JSON file of options (schemas/profile.v1.schema.json); flags win over it");
  c->add_option("--jnd-profile", args->jnd_profile,
                "JSON file of what judges could just tell (schemas/jnd-profile.v1.schema.json); wins over "
                "--profile, flags win over it");
  add_run_options(*c, *args);
  add_cache_options(*c, *args);
  add_report_options(*c, *args);
  add_stage_options(*c, *args);
  c->footer(kFooter);
  c->callback([args, &exit_code] {
    RunSettings run;
    BatchPlan plan;
    try {
      const PlanRequest request = plan_request(*args);
      run = run_settings(*args);
      plan = plan_batch(request);
      if (!run.depfile.empty() && plan.models.size() != 1)
        throw InputError("--depfile", "", "one model", std::to_string(plan.models.size()) + " models");
      check_reports(plan, run);
    } catch (const InputError& e) {  // what was asked for makes no sense: nothing has been compiled yet
      std::cerr << "texmesh compile: " << e.what() << '\n';
      exit_code = kExitUsage;
      return;
    }
    run.more_inputs.insert(run.more_inputs.end(), plan.files.begin(), plan.files.end());
    exit_code = run_batch(plan, run, std::cout);
  });
}

}  // namespace texmesh
