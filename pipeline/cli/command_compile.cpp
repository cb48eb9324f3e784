#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <thread>

#include "format/errors.h"
#include "pipeline/cli/commands.h"
#include "pipeline/file_resolver.h"
#include "pipeline/find_models.h"
#include "pipeline/jnd_profile.h"
#include "pipeline/options.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"
#include "pipeline/worker.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

/// Shorter names of options that people type often.
const std::map<std::string, std::string> kShortNames{
    {"ladder.rungs", "--rungs"},        {"ladder.subsampling", "--subsampling"},
    {"ladder.mode", "--ladder"},        {"scales.mesh_codec", "--mesh-codec"},
    {"fragmentation.fill", "--fill"},   {"lut.allocate", "--allocate"},
    {"perceptual_values.jnd", "--jnd"}, {"simplification.order", "--order"},
    {"package.title", "--title"},       {"import.up", "--up"}};

struct CompileArguments {
  std::vector<std::string> inputs;
  std::string output, profile, jnd_profile, cache, memory = "8GiB";
  int jobs = 0;
  std::uint64_t timeout_s = 3600, cpu_s = 0;
  bool no_cache = false, strict = false, json = false, quiet = false, verbose = false, fail_fast = false;
  std::map<std::string, std::string> options;  // path -> text
};

std::uint64_t parse_bytes(const std::string& text, const std::string& flag) {
  std::size_t end = 0;
  double v = 0;
  try {
    v = std::stod(text, &end);
  } catch (const std::exception&) {
    end = 0;
  }
  static const std::map<std::string, double> kUnits{
      {"", 1},     {"B", 1},        {"kB", 1e3},        {"MB", 1e6},
      {"GB", 1e9}, {"KiB", 1024.0}, {"MiB", 1048576.0}, {"GiB", 1073741824.0}};
  const auto unit = kUnits.find(text.substr(end));
  if (end == 0 || unit == kUnits.end() || !(v >= 0 && v * unit->second < 1e18))
    throw InputError(flag, "", "a size such as 500MB or 8GiB", text);
  return static_cast<std::uint64_t>(v * unit->second);
}

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
    if (const auto it = kShortNames.find(f.path()); it != kShortNames.end()) names += "," + it->second;
    app.add_option_function<std::string>(
           names, [&args, path = f.path()](const std::string& v) { args.options[path] = v; }, help_of(f))
        ->group("Stage " + f.stage)
        ->type_name("");
  }
}

/// Profile first, then the JND profile, then flags over both.
CompileOptions gather_options(const CompileArguments& args) {
  CompileOptions options;
  if (!args.profile.empty()) {
    const auto bytes = read_input_file(args.profile, 1 << 20);
    read_profile(options, std::string(bytes.begin(), bytes.end()), args.profile);
  }
  if (!args.jnd_profile.empty())
    read_jnd_profile(options, read_input_file(args.jnd_profile, 1 << 16), args.jnd_profile);
  std::vector<OptionField> fields = list_options(options);
  for (const auto& [path, text] : args.options)
    for (OptionField& f : fields)
      if (f.path() == path) set_option(f, text, "--" + path);
  check_options(options, "command line");
  return options;
}

void make_folders(const std::vector<ModelPath>& models) {
  for (const ModelPath& m : models) {
    const fs::path folder = fs::path(m.output).parent_path();
    std::error_code ec;
    if (!folder.empty()) fs::create_directories(folder, ec);
    if (ec) throw InputError(folder.string(), "", "an output folder", ec.message());
  }
}

OutputMode output_mode(const CompileArguments& args) {
  if (args.json) return OutputMode::kJson;
  if (args.quiet) return OutputMode::kQuiet;
  return ::isatty(STDOUT_FILENO) ? OutputMode::kTerminal : OutputMode::kPlain;
}

int exit_code_of(const std::vector<WorkerReport>& reports) {
  int code = kExitOk;
  for (const WorkerReport& r : reports) {
    if (r.result == ModelResult::kInternal) return kExitInternal;
    if (r.result != ModelResult::kOk && r.result != ModelResult::kUnchanged) code = kExitModelFailed;
  }
  return code;
}

int run_compile(const CompileArguments& args, const CompileOptions& options, const WorkerLimits& limits,
                const std::vector<ModelPath>& models) {
  make_folders(models);

  const int cores =
      std::max(1, args.jobs > 0 ? args.jobs : static_cast<int>(std::thread::hardware_concurrency()));
  const int parallel = std::min<int>(cores, static_cast<int>(models.size()));
  std::vector<WorkerJob> jobs;
  std::vector<std::string> names;
  for (const ModelPath& m : models) {
    jobs.push_back({m.input, m.output, write_profile(options),
                    args.no_cache ? "" : default_cache_folder(args.cache), args.strict,
                    std::max(1, cores / parallel)});
    names.push_back(models.size() == 1 ? fs::path(m.input).filename().string() : m.input);
  }
  Progress progress(std::cout, output_mode(args), names, args.verbose);
  const auto start = std::chrono::steady_clock::now();
  std::vector<bool> announced(jobs.size());
  const auto reports = run_workers(
      jobs, parallel, limits, args.fail_fast,
      [&](std::size_t job, const std::string& line) {
        if (!announced[job]) progress.started(job, jobs[job].output);
        announced[job] = true;
        progress.event(job, line);
      },
      [&](std::size_t job, const WorkerReport& report) { progress.finished(job, report, jobs[job].output); });
  progress.summary(reports, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  return exit_code_of(reports);
}

}  // namespace

void add_compile_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<CompileArguments>();
  CLI::App* c = app.add_subcommand("compile", "Compile textured scans into packages");
  c->add_option("INPUT", args->inputs,
                "Models (.glb .gltf .obj .ply .stl, range-scan .json), or folders of them")
      ->required();
  c->add_option("-o,--output", args->output, "NAME.texmesh for one model, a folder for several")->required();
  c->add_option("-j,--jobs", args->jobs, "Processors to use (default: all)")->check(CLI::Range(1, 1024));
  c->add_option("--profile", args->profile,
                "JSON file of options (schemas/profile.v1.schema.json); flags win over it");
  c->add_option("--jnd-profile", args->jnd_profile,
                "JSON file of what judges could just tell (schemas/jnd-profile.v1.schema.json); wins over "
                "--profile, flags win over it");
  c->add_option("--cache", args->cache,
                "Cache folder (default: TEXMESH_CACHE, else the user's cache folder)");
  c->add_flag("--no-cache", args->no_cache, "Compute everything, keep nothing");
  c->add_flag("--strict", args->strict, "Warnings are errors");
  c->add_flag("--fail-fast", args->fail_fast, "Start no further model after a failure");
  c->add_option("--memory", args->memory, "Most memory (address space) of one model's process")
      ->capture_default_str();
  c->add_option("--timeout", args->timeout_s, "Most seconds for one model, 0 = no limit")
      ->capture_default_str();
  c->add_option("--cpu-limit", args->cpu_s, "Most processor seconds for one model, 0 = no limit")
      ->capture_default_str();
  c->add_flag("--json", args->json, "One JSON event a line (schemas/event.v1.schema.json)");
  c->add_flag("-q,--quiet", args->quiet, "Only warnings and errors");
  c->add_flag("-v,--verbose", args->verbose, "Every stage and note");
  add_stage_options(*c, *args);
  c->footer(
      "Examples:\n"
      "  texmesh compile turtle.glb -o turtle.texmesh\n"
      "  texmesh compile scans/ -o packages/ --jobs 8 --cache /var/cache/texmesh\n"
      "  texmesh compile bust.obj -o bust.texmesh --profile museum.json --rungs 8,18,53,86\n\n"
      "Every stage option can stand in a profile under the same name: "
      "{\"version\":1,\"ladder\":{\"rungs\":[8,18,53,86]}}.\n"
      "Exit code: 0 all well, 1 some model failed, 2 usage, 3 internal error. A model that fails leaves no "
      "package.");
  c->callback([args, &exit_code] {
    CompileOptions options;
    WorkerLimits limits;
    std::vector<ModelPath> models;
    try {
      options = gather_options(*args);
      limits = {parse_bytes(args->memory, "--memory"), args->cpu_s, args->timeout_s};
      models = find_models(args->inputs, args->output);
    } catch (const InputError& e) {  // what was asked for makes no sense: nothing has been compiled yet
      std::cerr << "texmesh compile: " << e.what() << '\n';
      exit_code = kExitUsage;
      return;
    }
    exit_code = run_compile(*args, options, limits, models);
  });
}

}  // namespace texmesh
