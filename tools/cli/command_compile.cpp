// The commands that make packages: compile, and what serves it. cache; of large collections on many machines
// the list of models, and one summary of many runs.

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/about/source_annotations.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/batch/fleet/model_list.h"
#include "pipeline/batch/run.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/machine.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/publish/report/collection/collection_page.h"

namespace texmesh {
namespace {

/// A name beside --STAGE.OPTION.
struct ShortName {
  const char* name;
  bool everyday;  // one of the options that --help shows
};
const std::map<std::string, ShortName> kShortNames{{"package.title", {"--title", true}},
                                                   {"import.up", {"--up", true}},
                                                   {"proxies.mode", {"--proxies", false}},
                                                   {"atlas.mode", {"--atlas", false}},
                                                   {"ladder.rungs", {"--rungs", true}},
                                                   {"ladder.mode", {"--ladder", true}},
                                                   {"ladder.keep_source", {"--keep-source", true}},
                                                   {"ladder.subsampling", {"--subsampling", true}},
                                                   {"scales.mesh_codec", {"--mesh-codec", true}},
                                                   {"perceptual_values.jnd", {"--jnd", true}},
                                                   {"fragmentation.fill", {"--fill", true}}};
constexpr const char* kEverydayTitle = "What the package holds";

struct CompileArguments {
  PackageNames names = PackageNames::kStem;
  std::vector<std::string> inputs, layers;
  std::string output, profile, jnd_profile, meta, annotations, shard, costs;
  std::optional<std::uint64_t> memory_bytes;  // else four fifths of what the process may use
  CacheChoice cache;
  int jobs = 0;
  bool json = false, quiet = false, keep_going = false;
  RunSettings run;
  std::map<std::string, std::string> options;  // path -> text
  std::string meta_text;                       // what the file of --meta says
  std::string annotations_text;                // what the file of --annotations says, as annotations.json
};

/// The field's own text, what it may be and its default. Names of values and of symbols stay as they are.
std::string help_of(const OptionField& f) {
  std::string help = f.help;
  const std::string first = help.substr(0, help.find(' '));
  const bool is_name = first.ends_with(':') || help.compare(first.size(), 2, " =") == 0;
  if (!is_name && std::islower(static_cast<unsigned char>(first[first.size() > 1 ? 1 : 0])))
    help[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(help[0])));
  if (f.range && f.kind != OptionKind::kText) help += fmt::format(" [{:g}..{:g}]", f.range->lo, f.range->hi);
  if (!f.words.empty()) help += fmt::format(" {{{}}}", fmt::join(f.words, "|"));
  std::string text = option_text(f);
  std::erase(text, '"');
  return text.empty() ? help : help + " (default " + text + ")";
}

const char* value_name_of(const OptionField& f) {
  constexpr const char* kNames[] = {"true|false", "N", "X", "TEXT", "N,N...", "X,X...", "NAME"};
  return kNames[static_cast<std::size_t>(f.kind)];
}

/// The short name of a switch takes no value; --STAGE.OPTION does.
void add_stage_option(Command& c, const OptionField& f, CompileArguments& args) {
  const auto it = kShortNames.find(f.path());
  const bool is_short = it != kShortNames.end(), is_switch = f.kind == OptionKind::kSwitch;
  std::string names = "--" + f.path();
  if (is_short && !is_switch) names += std::string(",") + it->second.name;
  Option option = c.option(
      names, [&args, path = f.path()](const std::string& text) { args.options[path] = text; }, help_of(f),
      value_name_of(f));
  option.rare();
  if (!f.words.empty()) option.offers({f.words.begin(), f.words.end()});
  if (is_short && !is_switch && it->second.everyday) option.everyday(kEverydayTitle);
  if (!is_short || !is_switch) return;
  c.flag(
       it->second.name, [&args, path = f.path()] { args.options[path] = "true"; },
       "the same as " + names + " true")
      .rare()
      .everyday(kEverydayTitle, help_of(f));
}

void add_stage_options(Command& c, CompileArguments& args) {
  CompileOptions defaults;
  for (const OptionField& f : list_options(defaults)) {
    if (!f.has_flag) continue;
    c.group("Stage " + f.stage);
    add_stage_option(c, f, args);
  }
}

/// Defaults, the profile, then the JND profile over it.
CompileOptions base_options(const CompileArguments& args) {
  CompileOptions options;
  apply_profile(args.profile, options);
  if (!args.jnd_profile.empty())
    read_jnd_profile(options, read_input_file(args.jnd_profile, 1 << 16), args.jnd_profile);
  return options;
}

void read_meta_file(CompileArguments& args) {
  if (args.meta.empty()) return;
  const auto bytes = read_input_file(args.meta, kMaxAboutBytes);
  args.meta_text = read_meta(std::string(bytes.begin(), bytes.end()), args.meta);
}

void tell_of_notes(const Notes& notes) {
  for (const Note& note : notes) std::cerr << "texmesh: " << printable(note.place + ": " + note.text) << '\n';
}

/// What is left out of the file is told at once: it is the same for every model.
void read_annotations_file(CompileArguments& args) {
  if (args.annotations.empty()) return;
  Notes notes;
  args.annotations_text = read_notes_file(args.annotations, notes);
  tell_of_notes(notes);
}

/// Flags win over everything that a file says.
void apply_flags(const CompileArguments& args, CompileOptions& options) {
  std::vector<OptionField> fields = list_options(options);
  for (const auto& [path, text] : args.options) {
    const auto shorter = kShortNames.find(path);
    set_option(*find_option(fields, path), text,
               shorter == kShortNames.end() ? "--" + path : shorter->second.name);
  }
  options.package.meta = merge_meta(options.package.meta, args.meta_text);
  if (!args.annotations_text.empty()) options.package.annotations = args.annotations_text;
  check_options(options, "command line");
}

OutputMode output_mode(const CompileArguments& args) {
  if (args.json) return OutputMode::kJson;
  if (args.quiet) return OutputMode::kQuiet;
  return ::isatty(STDOUT_FILENO) ? OutputMode::kTerminal : OutputMode::kPlain;
}

void check_sandbox(SandboxMode mode) {
  if (mode != SandboxMode::kRequire) return;
  if (const SandboxSupport s = sandbox_support(); !s.complete())
    throw UsageError("--sandbox require", "", "bounds on files and calls", describe_sandbox(s));
}

/// What a verbose run says of the processes that it is going to start.
std::string sandbox_line(SandboxMode mode) {
  if (mode == SandboxMode::kOff) return "sandbox: off";
  const SandboxSupport s = sandbox_support();
  return std::string(s.complete() ? "sandbox: " : "sandbox, degraded: ") + describe_sandbox(s);
}

PlanRequest plan_request(const CompileArguments& args) {
  check_folder_name(args.output, ".texmesh");
  PlanRequest request;
  request.inputs = args.inputs;
  request.output = args.output;
  request.base = std::make_shared<const CompileOptions>(base_options(args));
  request.apply_flags = [&args](CompileOptions& options) { apply_flags(args, options); };
  CompileOptions check = *request.base;  // wrong flags are an error even where there is nothing to compile
  apply_flags(args, check);
  request.names = args.names;
  request.shard = shard_option(args.shard);
  request.costs_s = costs_option(args.costs);
  return request;
}

RunSettings run_settings(const CompileArguments& args) {
  RunSettings run = args.run;
  const MachineShare share = machine_share();
  run.pool.processors = args.jobs > 0 ? args.jobs : share.processors;
  run.pool.memory_bytes = args.memory_bytes.value_or(share.memory_bytes / 5 * 4);
  check_sandbox(run.pool.limits.sandbox);
  if (!args.cache.off) run.cache.folder = default_cache_folder(args.cache.folder);
  run.cache.layers = args.layers;
  for (std::string& layer : layers_from_environment()) run.cache.layers.push_back(std::move(layer));
  for (const std::string& layer : run.cache.layers) check_layer(layer);
  for (const std::string& folder : run.links_within)
    if (!std::filesystem::is_directory(folder))
      throw UsageError("--links-within", "", "a folder that is there", folder);
  run.mode = output_mode(args);
  for (const std::string& file : {args.profile, args.jnd_profile, args.meta, args.annotations})
    if (!file.empty()) run.more_inputs.push_back(file);
  return run;
}

Option add_names_option(Command& c, PackageNames& names) {
  return c
      .choice(
          "--names", names,
          "What packages of a folder's models are called: stem = bust.texmesh, full = bust.glb.texmesh of bust.glb. "
          "Two models of one name are refused",
          "NAMES")
      .lists_words()
      .shows_default();
}

void add_run_options(Command& c, CompileArguments& args) {
  RunSettings& run = args.run;
  c.group("Running");
  add_jobs_option(c, args.jobs);
  c.option(
       "--memory", args.memory_bytes, parse_bytes,
       "Limit for the memory of all models that run at the same time; compile estimates each model by its "
       "last run (default: 4/5 of what machine, cgroup and Slurm allow). A model that needs more runs "
       "alone, see --model-memory",
       "SIZE")
      .rare();
  c.option("--model-memory", run.pool.limits.memory_bytes, parse_bytes,
           "Most memory (address space) of one model's process", "SIZE")
      .shows_default("8GiB")
      .rare();
  c.option("--timeout", run.pool.limits.wall_s, "Most seconds for one model, 0 = no limit").shows_default();
  c.option("--cpu-limit", run.pool.limits.cpu_s, "Most processor seconds for one model, 0 = no limit")
      .shows_default()
      .rare();
  c.choice(
       "--sandbox", run.pool.limits.sandbox,
       "Limits a model's process. auto = it reaches the model's folder, its result and the cache, starts no "
       "program, and has no network but cache layers, as far as the kernel can enforce this; require = the "
       "same, and compile stops if the kernel cannot; off = no limits",
       "NAME")
      .shows_default()
      .rare();
  c.option(
       "--links-within", run.links_within,
       "Follow a model's symbolic links where they lead to a file within DIR, too (git-annex, DVC, Bazel); "
       "may be given several times. Links within the folder that INPUT names are always followed",
       "DIR")
      .rare();
  add_names_option(c, args.names).rare();
  add_shard_options(c, args.shard, args.costs);
  Option keep_going =
      c.flag("--keep-going", args.keep_going, "Compile the other models after a failure (default)").rare();
  c.flag("--fail-fast", run.pool.stop_on_failure, "Start no further model after a failure")
      .excludes(keep_going);
  c.flag("--retry-failed", run.retry_failed,
         "Try models again that failed before, though nothing has changed since");
  c.flag("--remove-stale", run.remove_stale,
         "Remove packages of the output folder that no model makes any more; without it compile names them");
  c.flag("--strict", run.strict, "Treat warnings as errors");
}

void add_all_cache_options(Command& c, CompileArguments& args) {
  c.group("Cache");
  add_cache_options(c, args.cache);
  c.option("--cache-layer", args.layers,
           "Folder or http(s) URL to ask behind the cache folder; may be given several times (also "
           "TEXMESH_CACHE_LAYERS, separated by blanks)",
           "PLACE")
      .rare();
  c.flag("--cache-upload", args.run.cache.upload, "Put what is computed into the layers that are URLs")
      .rare();
  c.option("--cache-size", args.run.cache_limits.max_bytes, parse_bytes,
           "The cache folder is pruned to this size, 0 = no limit", "SIZE")
      .shows_default("20GB")
      .rare();
  c.option("--cache-age", args.run.cache_limits.max_age_s, parse_seconds,
           "Results unused for this long are pruned, 0 = never", "TIME")
      .shows_default("90d")
      .rare();
}

/// Every stage with its version, what it makes and what it reads.
std::string graph_text() {
  std::string text;
  for (const Stage& s : default_stage_table()) {
    std::string inputs;
    for (const auto& input : s.inputs) inputs += (inputs.empty() ? "" : ", ") + input.name;
    text += fmt::format("{:<18} v{:<4} {}\n{:<25}from {}\n", s.name, s.version, s.summary, "", inputs);
  }
  return text;
}

void add_report_options(Command& c, CompileArguments& args) {
  RunSettings& run = args.run;
  c.group("Reports");
  c.flag("-n,--dry-run", run.dry_run, "Say what would run and why; write nothing");
  c.flag("--explain", run.explain, "Say whether each stage runs, and why (--stages lists them)");
  c.text_option("--stages", graph_text, "Print the graph of stages").rare();
  c.flag("--stats", run.statistics, "Print a table of stages at the end: runs, cache hits, seconds");
  c.flag("-q,--quiet", args.quiet, "Print only warnings and errors");
  c.flag("-v,--verbose", run.verbose, "Print every stage and note");
  c.flag("--json", args.json, "Print one JSON event on each line (schemas/event.v1.schema.json)");
  c.option("--summary", run.summary, "Write every model's result as JSON (schemas/summary.v1.schema.json)",
           "FILE");
  c.option("--junit", run.junit, "Write every model's result as JUnit XML", "FILE");
  c.option("--depfile", run.depfile, "Write the package's dependencies for make and ninja (one model only)",
           "FILE")
      .rare();
  c.option("--trace", run.trace, "Write what ran when, for chrome://tracing or Perfetto", "FILE").rare();
}

constexpr const char* kExamples =
    "  texmesh compile turtle.glb -o turtle.texmesh             one model, one package\n"
    "  texmesh compile scans/ -o packages/ --jobs 8             every model of a folder";

constexpr const char* kNotes =
    "More examples:\n"
    "  texmesh compile collection.json -o packages/ --junit report.xml\n"
    "  texmesh compile scans/ -o packages/ --dry-run            what would run, and why\n"
    "  texmesh compile scans/ -o packages/ --shard auto         an array task's part (examples/slurm)\n"
    "  texmesh compile bust.obj -o bust.texmesh --profile museum.json --rungs 8,18,53,86\n\n"
    "Every stage option can stand in a profile under the same name: "
    "{\"version\":1,\"ladder\":{\"rungs\":[8,18,53,86]}}.\n"
    "A package is made again only when its model, a file that the model refers to, an option or texmesh has "
    "changed. A model that fails leaves the package that was there before.\n"
    "Exit code: 0 all well, 1 some model failed, 2 usage, 3 internal, 75 try again.";

void add_compile_options(Command& c, CompileArguments& args) {
  c.option(
       "INPUT", args.inputs,
       "Models (.glb .gltf .obj .ply .stl, .zip archives of these, range-scan .json), folders of models, or collections (.json)")
      .required();
  c.option("-o,--output", args.output, "NAME.texmesh for one model, a folder for several models", "OUTPUT")
      .required();
  c.option(
      "--profile", args.profile,
      "small = few bytes, archive = the source's own images and finer meshes, fast = little time, thesis = "
      "as printed; or a JSON file of options. Flags win",
      "NAME");
  c.option(
       "--jnd-profile", args.jnd_profile,
       "JSON file of what judges could just tell (schemas/jnd-profile.v1.schema.json). The file wins over "
       "--profile, flags win over the file",
       "FILE")
      .rare();
  c.option("--meta", args.meta, "JSON about the object (schemas/meta.v1.schema.json); it wins over the model",
           "FILE")
      .everyday(kEverydayTitle);
  c.option(
       "--annotations", args.annotations,
       "Notes at points of the object: texmesh's own form (schemas/annotations.v2.schema.json), Sketchfab's, "
       "Voyager's or W3C's; in the coordinates of the source",
       "FILE")
      .rare();
  c.help_option("--help-stage", "Stage ", "Print the options of one stage (--stages lists the stages)");
  add_run_options(c, args);
  add_all_cache_options(c, args);
  add_report_options(c, args);
  add_stage_options(c, args);
}

int run_compile(CompileArguments& args) {
  RunSettings settings;
  const BatchPlan plan = as_usage([&] {  // nothing has been compiled yet
    read_meta_file(args);
    read_annotations_file(args);
    if (!args.profile.empty()) args.profile = profile_file(args.profile);
    const PlanRequest request = plan_request(args);
    settings = run_settings(args);
    BatchPlan models = plan_batch(request);
    if (!settings.depfile.empty() && models.models.size() != 1)
      throw InputError("--depfile", "", "one model", std::to_string(models.models.size()) + " models");
    check_reports(models, settings);
    if (args.options.contains("package.title") && models.models_in_collection > 1)
      add_warning(models.notes, "one-title", "--title",
                  "all " + std::to_string(models.models_in_collection) +
                      " packages have this title; a collection.json gives each its own");
    tell_of_notes(models.notes);
    return models;
  });
  if (plan.shard.count > 1 && settings.mode != OutputMode::kJson && settings.mode != OutputMode::kQuiet)
    std::cout << "shard " << plan.shard.index << " of " << plan.shard.count << ": " << plan.models.size()
              << " of " << plan.models_in_collection << " models" << std::endl;
  if (settings.verbose && !args.json) std::cout << sandbox_line(settings.pool.limits.sandbox) << std::endl;
  settings.more_inputs.insert(settings.more_inputs.end(), plan.files.begin(), plan.files.end());
  try {
    return run_batch(plan, settings, std::cout);
  } catch (const PermissionError&) {
    throw;
  } catch (const ResourceError& e) {
    std::cerr << "texmesh: " << printable(e.what()) << '\n';
    return kExitTryAgain;
  }
}

using Json = nlohmann::ordered_json;

struct CacheArguments {
  std::string cache;
  CacheLimits limits;
  bool json = false;
};

std::string folder_of(const CacheArguments& args) {
  std::string folder = default_cache_folder(args.cache);
  if (folder.empty())
    throw InputError("--cache", "", "a cache folder (--cache, TEXMESH_CACHE, XDG_CACHE_HOME or HOME)",
                     "none of them");
  return folder;
}

std::string existing_folder_of(const CacheArguments& args) {
  std::string folder = folder_of(args);
  if (!std::filesystem::is_directory(folder)) throw InputError(folder, "", "a cache folder", "nothing there");
  return folder;
}

void statistics(const CacheArguments& args) {
  const CacheStatistics s = cache_statistics(existing_folder_of(args));
  if (args.json) {
    std::cout << Json{{"folder", folder_of(args)},    {"bytes", s.bytes()},
                      {"records", s.entries},         {"blobs", s.blobs},
                      {"blob_bytes", s.blob_bytes},   {"notes", s.notes},
                      {"quarantined", s.quarantined}, {"quarantined_bytes", s.quarantined_bytes},
                      {"running_builds", s.running},  {"oldest_use_s", s.oldest_use_s}}
                     .dump(1)
              << '\n';
    return;
  }
  std::cout << fmt::format(
      "folder         {}\nsize           {}\nresults        {} runs of stages, {} outputs of {}\nquarantined "
      "   {} of {}\n"
      "oldest use     {:.1f} days ago\nrunning builds {}\n",
      folder_of(args), format_bytes(s.bytes()), s.entries, s.blobs, format_bytes(s.blob_bytes), s.quarantined,
      format_bytes(s.quarantined_bytes), static_cast<double>(s.oldest_use_s) / 86400, s.running);
}

void prune(const CacheArguments& args) {
  const PruneResult r = prune_cache(existing_folder_of(args), args.limits);
  if (args.json) {
    std::cout << Json{{"removed_records", r.entries}, {"removed_blobs", r.blobs},
                      {"removed_others", r.others},   {"removed_bytes", r.bytes},
                      {"kept_bytes", r.kept_bytes},   {"kept_in_use", r.kept_in_use}}
                     .dump(1)
              << '\n';
    return;
  }
  std::cout << fmt::format(
      "removed {} results with {} outputs, {}; {} are left{}\n", r.entries, r.blobs, format_bytes(r.bytes),
      format_bytes(r.kept_bytes),
      r.kept_in_use ? fmt::format(" ({} results are in use by running builds)", r.kept_in_use) : "");
}

int verify(const CacheArguments& args) {
  const std::vector<CacheDamage> damage = verify_cache(existing_folder_of(args));
  Json list = Json::array();
  for (const CacheDamage& d : damage) {
    list.push_back({{"path", d.path}, {"reason", d.reason}});
    if (!args.json) std::cout << printable(d.path) << ": " << d.reason << "; moved to quarantine\n";
  }
  if (args.json)
    std::cout << Json{{"damaged", list}}.dump(1) << '\n';
  else if (damage.empty())
    std::cout << "every object has its digest\n";
  return damage.empty() ? kExitOk : kExitModelFailed;
}

namespace fs = std::filesystem;

struct ListArguments {
  PackageNames names = PackageNames::kStem;
  std::vector<std::string> inputs;
  std::string output, costs;
  int shards = 1;
  bool json = false;
};

int run_list(const ListArguments& args) {
  PlanRequest request;
  request.inputs = args.inputs;
  request.output = args.output;
  request.names = args.names;
  request.costs_s = costs_option(args.costs);
  const ModelList list = list_collection(request, args.shards);
  if (args.json) {
    std::cout << write_model_list(list);
    return kExitOk;
  }
  for (const ListedModel& m : list.models) {
    std::cout << printable(m.input + " -> " + m.output) << "  " << format_bytes(m.bytes);
    if (args.shards > 1) std::cout << "  shard " << m.shard;
    std::cout << '\n';
  }
  for (const std::string& package : list.stale)
    std::cout << printable(package)
              << ": no model makes this package any more (compile --remove-stale removes it)\n";
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
  if (error) fail_to_write((folder / posters).string(), "", error.value());
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
    std::cerr << "texmesh summary: " << p.kind << ": "
              << printable((p.file.empty() ? "" : p.file + ": ") + p.text) << '\n';
  const SummaryCounts c = count_results(merged.models);
  std::cout << fmt::format("{} compiled, {} up to date, {} failed, {} cancelled in {} {}, {}\n", c.compiled,
                           c.unchanged, c.failed, c.cancelled, merged.parts.size(),
                           merged.parts.size() == 1 ? "run" : "runs", format_seconds(merged.seconds));
  return exit_code_of(merged);
}

}  // namespace

void add_compile_command(Command& app) {
  auto [c, args] = app.add("compile", "Compile textured scans into packages", run_compile);
  add_compile_options(c, args);
  c.examples(kExamples);
  c.notes(kNotes);
}

void add_cache_command(Command& app) {
  auto args = std::make_shared<CacheArguments>();
  Command c = app.add("cache", "Look at, prune or check the cache folder");
  c.needs_command();
  const auto add = [&](const char* name, const char* help, std::function<int(const CacheArguments&)> run) {
    Command command = c.add(name, help);
    command.option("--cache", args->cache,
                   "Cache folder (default: TEXMESH_CACHE, else the user's cache folder)", "DIR");
    if (std::string(name) != "path") command.flag("--json", args->json, "Print JSON");
    command.on_run([args, run] { return as_usage([&] { return run(*args); }); });
    return command;
  };
  add("stat", "Print how much the folder holds",
      [](const CacheArguments& a) { return statistics(a), kExitOk; });
  Command p = add("prune", "Remove the results that have not been used for longest",
                  [](const CacheArguments& a) { return prune(a), kExitOk; });
  p.option("--size", args->limits.max_bytes, parse_bytes, "Most bytes that stay (default 20GB, 0 = no limit)",
           "SIZE");
  p.option("--age", args->limits.max_age_s, parse_seconds,
           "Longest time that an unused result stays (default 90d, 0 = no limit)", "TIME");
  add("verify", "Read every object and move damaged ones to quarantine (exit code 1 when there are any)",
      verify);
  add("path", "Print the folder", [](const CacheArguments& a) {
    std::cout << folder_of(a) << '\n';
    return kExitOk;
  });
  c.notes(
      "Builds prune the folder (compile --cache-size, --cache-age). Pruning never touches what a running "
      "build uses.\n"
      "The folder may be deleted: everything in it can be computed again.");
}

void add_list_command(Command& app) {
  auto args = std::make_shared<ListArguments>();
  Command c = app.add("list", "List the models of a collection with their packages and files");
  c.option("INPUT", args->inputs, "Models, folders of models, or collections (.json), as compile takes them")
      .required();
  c.option("-o,--output", args->output, "Where the packages would go, as compile takes it", "OUTPUT")
      .required();
  c.option("--shards", args->shards, "Say of every model which of so many shards compile --shard gives it to")
      .integer_in(1, 1'000'000);
  c.option("--costs", args->costs, "As for compile --shard", "FILE");
  add_names_option(c, args->names);
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
  merge.option("-o,--output", args->output, "Write the merged summary (schemas/summary.v1.schema.json)",
               "FILE");
  merge.option("--junit", args->junit, "Write every model's result as JUnit XML", "FILE");
  merge.option("--html", args->html,
               "Write a page: what went wrong first, then figures, then the packages with their posters",
               "FILE");
  merge.option("--posters", args->posters, "Most posters on the page").integer_in(0, 100'000).shows_default();
  merge.examples("  texmesh summary merge report/*.json -o all.json --junit all.xml --html all.html");
  merge.notes(
      "merge names summaries that are half-written, foreign (of another collection) or double, and shards "
      "without a summary.\n"
      "Exit code: as compile's for the models of all runs; 75 also where a shard is missing or half-written, 1 "
      "also where a summary is foreign.");
  merge.on_run([args] {
    try {
      return as_usage([&] { return run_merge(*args); });
    } catch (const PermissionError& e) {  // exit code 1 says that a model failed
      throw UsageError(e.file(), e.place(), e.expected(), e.found());
    }
  });
}

}  // namespace texmesh
