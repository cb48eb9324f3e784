// One model, from its files to its package: what it is made of, its provenance, the graph over it.
#include "pipeline/compile/compile_model.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "pipeline/about/source_annotations.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/graph/memory_store.h"
#include "pipeline/import/archive/archive_files.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/machine.h"
#include "pipeline/io/program.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

/// What is asked of files, without the stamps, which are no part of any key.
std::string note_of(std::vector<FileRequest> requests) {
  for (FileRequest& r : requests) r.stamp = {};
  return json_line_of([&](Json& to) { put_value(to, requests); });
}

std::optional<std::vector<FileRequest>> requests_of(const std::string& note) {
  try {
    return from_json<std::vector<FileRequest>>(Json::parse(note, nullptr, false), "note");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

/// Before work begins, instead of after minutes of it.
void refuse_too_large(const std::string& name, const Bytes& bytes, std::uint64_t limit_bytes) {
  const std::uint64_t known = this_machine().memory_bytes, machine = known > 0 ? known : ~0ull;
  const std::uint64_t most = limit_bytes > 0 ? std::min(limit_bytes, machine) : machine;
  const std::uint64_t triangles = count_triangles(name, bytes), needed = least_memory_bytes(triangles);
  if (needed <= most) return;
  const auto gigabytes = [](std::uint64_t n) {
    return fmt::format("{:.1f} GB", static_cast<double>(n) / 1e9);
  };
  throw ResourceError(name, "",
                      fmt::format("a model that {} of memory are enough for ({})", gigabytes(most),
                                  most == machine ? "the machine's" : "--model-memory"),
                      fmt::format("{} triangles, which take {} or more", triangles, gigabytes(needed)));
}

/// A file that the package was made from, as provenance.json has it.
struct ProvenanceInput {
  std::string role, uri;
  Sha256 digest{};
  std::uint64_t bytes = 0;
  static void fields(auto& s, auto&& v) {
    v("role", s.role, "");
    v("uri", s.uri, kMayMiss, "");
    v("sha256", s.digest, "");
    v("bytes", s.bytes, "");
  }
};

ModelSize size_of(const Model& model) {
  ModelSize size{0, 0, static_cast<double>(model.images.size())};
  for (const Image& image : model.images) size.megapixels += 1e-6 * image.width_px * image.height_px;
  size.triangles = static_cast<double>(model.mesh.triangles.size());
  return size;
}

/// The model file with the files it refers to. Which those are is known only after an import, so the store
/// remembers the list of the last one (as ccache's manifest does): while every file on it reads as it did,
/// import need not run.
class ModelSource {
 public:
  explicit ModelSource(const CompileRequest& request)
      : path_(request.input),
        options_(request.options.import),
        memory_bytes_(request.memory_bytes),
        size_known_(request.size_known),
        links_within_(request.links_within),
        known_(request.known) {}

  /// Reads what is needed to know parts(). Before anything else. `may_write_notes`: the store may be told the
  /// list. InputError, ResourceError, Cancelled.
  void open(Store& store, const RunContext& context, bool may_write_notes) {
    look_at_model();
    const Sha256 note_key = list_key();
    if (const auto note = store.find_note(note_key); note && unchanged_since(*note)) return;
    imported_ = std::make_shared<ImportedModel>(import(options_, context, requests_));
    if (may_write_notes) store.put_note(note_key, note_of(requests_));
  }

  /// What the model is made of: its own bytes, and every file that it asked for, found or not.
  std::vector<std::pair<std::string, std::string>> parts() const {
    Key key("source", 1);
    key.add("extension", lower_ending(path_.native()));
    key.add_input("model", main_.digest, main_.bytes);
    for (const FileRequest& r : requests_)
      if (r.similar)
        key.add("input names like " + to_wire(r.uri), to_hex(r.digest));
      else if (r.found)
        key.add_input("file " + to_wire(r.uri), r.digest, r.bytes);
      else
        key.add("input file " + to_wire(r.uri), "not there");
    return key.added_parts();
  }
  Sha256 digest() const { return digest_of_parts(parts()); }

  /// Imports the model, unless open() has. InputError when a file is not what it was at open(). Refers to
  /// this object.
  SourceModel source() {
    return {[this](const ImportOptions& options, const RunContext& context) {
      if (imported_) return std::move(*std::exchange(imported_, nullptr));
      std::vector<FileRequest> again;
      ImportedModel model = import(options, context, again);
      if (note_of(again) != note_of(requests_))
        throw InputError(path_.filename().string(), "", "files that stay as they are while they are compiled",
                         "one that has changed meanwhile");
      return model;
    }};
  }

  /// The notes that an archive has beside its model, as texmesh writes them; "" without any. Where they
  /// cannot be read, `notes` says so. InputError when the archive is not what it was at open().
  std::string archived_notes(Notes& notes) {
    if (!is_archive()) return "";
    if (!archived_) {
      // Only a stamp that has settled tells that the file is still the same.
      if (!has_bytes_ && !main_.stamp.is_settled(wall_clock_ns())) read_model();
      read_archived_notes();
      if (!has_bytes_ && stamp_of(path_.string()) != main_.stamp) refuse_changed();
      forget_bytes();
    }
    notes.insert(notes.end(), archived_->second.begin(), archived_->second.end());
    return archived_->first;
  }

  /// For provenance: the model's own references, never the paths of this machine.
  std::vector<ProvenanceInput> inputs() const {
    std::vector<ProvenanceInput> all{{"model", "", main_.digest, main_.bytes}};
    for (const FileRequest& r : requests_)
      if (r.found && !r.similar) all.push_back({"file", readable_name(r.uri), r.digest, r.bytes});
    return all;
  }

  /// The model, then what it asked for, in that order.
  std::vector<FileRequest> files() const {
    std::vector<FileRequest> all;
    if (main_.found) all.push_back(main_);
    all.insert(all.end(), requests_.begin(), requests_.end());
    return all;
  }

 private:
  void look_at_model() {
    const auto stamp = stamp_of(path_.string());
    for (const FileRequest& r : known_)
      if (r.uri.empty() && r.found && stamp && *stamp == r.stamp) {
        main_ = r;
        return;
      }
    read_model();
  }
  [[noreturn]] void refuse_changed() const {
    throw InputError(path_.filename().string(), "", "a file that stays as it is while it is compiled",
                     "one that has changed meanwhile");
  }
  bool is_archive() const { return lower_ending(path_.native()) == ".zip"; }
  /// Of the bytes, where they have been read, else of the file.
  void read_archived_notes() {
    std::string place = path_.filename().string();
    auto& [text, said] = archived_.emplace();
    try {
      ArchiveFiles archive(has_bytes_ ? memory_source(bytes_, place) : open_file_source(path_.string()),
                           kAnyArchiveSize);
      if (const auto file = archived_annotations(archive)) {
        place += "/" + file->first;
        text = write_annotations(read_source_annotations(file->second, place, said));
      }
    } catch (const Error& e) {
      add_warning(said, "annotations", place, std::string("the notes are left out: ") + e.what());
    }
  }
  /// A file of a gigabyte need not wait for the package. Whoever needs it again reads it again.
  void forget_bytes() {
    bytes_ = {};
    has_bytes_ = false;
  }
  void read_model() {
    FileStamp stamp;
    bytes_ = read_input_file(path_, static_cast<std::uint64_t>(options_.max_file_bytes), &stamp);
    has_bytes_ = true;
    const FileRequest found{"", true, sha256(bytes_), bytes_.size(), stamp, false};
    if (main_.found && (found.digest != main_.digest || found.bytes != main_.bytes)) refuse_changed();
    main_ = found;
  }
  Sha256 list_key() const {
    Key key("import-files", kImportVersion);
    key.add("extension", lower_ending(path_.native()));
    key.add_input("model", main_.digest, main_.bytes);
    OptionTexts texts;
    append_field_texts("import", options_, texts);
    for (auto& [path, text] : texts) key.add(std::move(path), std::move(text));
    return key.digest();
  }
  bool unchanged_since(const std::string& note) {
    const auto asked = requests_of(note);
    if (!asked) return false;
    FileResolver resolver(path_.parent_path(), links_within_);
    resolver.expect(known_);
    for (const FileRequest& r : *asked) {
      try {
        if (r.similar)
          resolver.similar(r.uri);
        else
          resolver.look(r.uri, static_cast<std::uint64_t>(options_.max_file_bytes));
      } catch (const FileRefused&) {  // counts as missing
      } catch (const InputError&) {
        return false;  // the import itself must say what is wrong
      }
    }
    if (note_of(resolver.requests()) != note) return false;
    requests_ = resolver.requests();
    return true;
  }
  ImportedModel import(const ImportOptions& options, const RunContext& context,
                       std::vector<FileRequest>& requests) {
    if (!has_bytes_) read_model();
    FileResolver resolver(path_.parent_path(), links_within_);
    try {
      refuse_too_large(path_.filename().string(), bytes_, memory_bytes_);
      ImportedModel m = import_model(path_.filename().string(), bytes_, resolver, options, context);
      requests = resolver.requests();
      if (size_known_) size_known_(size_of(m.model));
      if (is_archive() && !archived_) read_archived_notes();
      forget_bytes();
      return m;
    } catch (const ResourceError&) {
      throw;
    } catch (const InputError& e) {
      requests = resolver.requests();
      if (resolver.failed_for_resources()) throw ResourceError(e.file(), e.place(), e.expected(), e.found());
      throw;
    } catch (...) {
      requests = resolver.requests();  // what a failure depends on, too
      throw;
    }
  }

  std::filesystem::path path_;
  ImportOptions options_;  // of open()
  std::uint64_t memory_bytes_ = 0;
  std::function<void(const ModelSize&)> size_known_;
  std::vector<std::string> links_within_;
  std::vector<FileRequest> known_;
  Bytes bytes_;
  bool has_bytes_ = false;
  std::optional<std::pair<std::string, Notes>> archived_;  // an archive's notes, and what is wrong with them
  FileRequest main_;
  std::vector<FileRequest> requests_;
  std::shared_ptr<ImportedModel> imported_;
};

/// What made the package, without dates, hosts or paths. What package.meta and
/// package.annotations say stands in about.json and annotations.json.
std::string provenance(const ModelSource& source, const CompileOptions& options) {
  Json stages = Json::object(), libraries = Json::object();
  for (const Stage& s : stage_table(options))
    if (s.stored) stages[s.name] = s.version;
  for (const auto& [name, version] : library_versions()) libraries[name] = version;
  CompileOptions recorded = options;
  recorded.package.meta.clear();
  Json profile = profile_json(recorded);
  profile["package"].erase("annotations");
  if (options.atlas.mode == AtlasMode::kKeep) profile.erase("atlas");  // as before there was such a stage
  if (options.zim.weights.empty()) profile["zim"].erase("weights");    // likewise
  return Json{{"version", 1},
              {"tool", "texmesh " + tool_version()},
              {"format", {{"major", kFormatMajor}, {"minor", 0}}},  // stage package knows the minor
              {"inputs", to_json(source.inputs())},
              {"options", std::move(profile)},
              {"stages", stages},
              {"libraries", libraries}}
      .dump();
}

/// The options with the notes that an archive has beside its model, where the user gives no others.
CompileOptions with_archived_notes(CompileOptions options, ModelSource& source, Notes& notes) {
  if (options.package.annotations.empty()) options.package.annotations = source.archived_notes(notes);
  return options;
}

void refuse_warnings(const Notes& notes, const std::string& input) {
  for (const Note& n : notes)
    if (n.severity == Severity::kWarning)
      throw InputError(fs::path(input).filename().string(), n.place, "no warning (--strict)",
                       n.code + ": " + n.text);
}

/// The graph over one model.
class ModelGraph {
 public:
  ModelGraph(ModelSource& source, std::vector<Stage> stages, const CompileOptions& options, Store& store,
             const RunContext& context, const StageObserver& observer)
      : stages_(std::move(stages)), graph_(stages_, store, context, observer) {
    graph_.give(kSource, source.source(), source.digest(), 0, source.parts());
    const std::string json = provenance(source, options);
    graph_.give(kProvenance, json, sha256(text_bytes(json)), json.size());
  }
  GraphRun& operator*() { return graph_; }
  GraphRun* operator->() { return &graph_; }

 private:
  std::vector<Stage> stages_;
  GraphRun graph_;  // refers to stages_, which therefore stands first
};

CompileOptions options_with_atlas(CompileOptions options, AtlasMode mode) {
  options.atlas.mode = mode;
  return resolve_options(std::move(options));
}

/// Options with keep or rebuild where `resolved` has auto. The package is the one of that mode.
class AtlasChooser {
 public:
  AtlasChooser(const CompileOptions& resolved, ModelSource& source, Store& store, const RunContext& context)
      : resolved_(resolved),
        source_(source),
        store_(is_open() && !store.keeps_results() ? memory_ : store),
        context_(context) {}

  bool is_open() const { return resolved_.atlas.mode == AtlasMode::kAuto && !resolved_.ladder.keep_source; }
  /// Has what was looked at, so that the package's graph does not make it again.
  Store& store() { return store_; }
  StageKeys keys;  // of the stages that looked

  /// Tells nothing of results that only this model has kept: a run without a cache has none of a cache.
  StageObserver without_own_hits(const StageObserver& observer) const {
    if (!observer || &store_ != &memory_) return observer;
    return [observer](const Stage& stage, StageEvent event, double fraction, double seconds) {
      if (event != StageEvent::kHit) observer(stage, event, fraction, seconds);
    };
  }

  /// Tells each stage that runs, and those that do not once.
  StageExplainer explain_once(StageExplainer explainer) {
    if (!explainer) return {};
    return [this, explainer = std::move(explainer)](const Stage& stage, const StageExplanation& e) {
      if (told_.insert(stage.name).second || e.verdict != StageVerdict::kHit) explainer(stage, e);
    };
  }

  CompileOptions choose(const StageKeys& earlier, const StageExplainer& explainer,
                        const StageObserver& observer, Notes& notes) {
    if (resolved_.atlas.mode != AtlasMode::kAuto) return resolved_;
    if (!is_open()) {
      add_info(notes, kChosenAtlasNote, "",
               "auto keeps the source's atlas: --keep-source asks for its files");
      return options_with_atlas(resolved_, AtlasMode::kKeep);
    }
    const auto sample_of = [&](AtlasMode mode) { return sample(mode, earlier, explainer, observer); };
    const AtlasSample kept = sample_of(AtlasMode::kKeep);
    const AtlasChoice choice = choose_atlas(kept, kept.good.empty() ? sample_of(AtlasMode::kRebuild) : kept);
    memory_.close();
    const std::string lost = choice.rebuild ? std::string(". ") + kLostByRebuilding : "";
    add_info(notes, kChosenAtlasNote, "", choice.why + lost);
    return options_with_atlas(resolved_, choice.rebuild ? AtlasMode::kRebuild : AtlasMode::kKeep);
  }

  /// How the source's charts look, or new ones.
  AtlasSample sample(AtlasMode mode, const StageKeys& earlier, const StageExplainer& explainer,
                     const StageObserver& observer) {
    const CompileOptions options = options_with_atlas(resolved_, mode);
    const Stage last = atlas_choice_stage(options);
    ModelGraph graph(source_, graph_towards(last, options), options, store_, context_, observer);
    graph->explain(earlier, explainer);
    AtlasSample found = *graph->run(kAtlasSample);
    keys[last.name] = graph->keys().at(last.name);
    return found;
  }

 private:
  const CompileOptions& resolved_;
  ModelSource& source_;
  MemoryStore memory_;
  Store& store_;
  const RunContext& context_;
  std::set<std::string> told_;
};

CompileOutcome compile_source(const CompileRequest& request, const CompileOptions& resolved,
                              ModelSource& source, Store& store, const RunContext& context,
                              const StageObserver& asked_observer) {
  source.open(store, context, true);
  Notes notes;
  AtlasChooser chooser(resolved, source, store, context);
  const StageExplainer explainer = chooser.explain_once(request.explainer);
  const StageObserver observer = chooser.without_own_hits(asked_observer);
  const CompileOptions options =
      with_archived_notes(chooser.choose(request.earlier_keys, explainer, observer, notes), source, notes);
  ModelGraph graph(source, stage_table(options), options, chooser.store(), context, observer);
  graph->explain(request.earlier_keys, explainer);
  const std::shared_ptr<const Bytes> package = graph->run(kPackage);

  CompileOutcome outcome;
  outcome.package_bytes = package->size();
  outcome.package_digest = sha256(*package);
  outcome.notes = graph->notes();
  if (chooser.is_open())
    std::erase_if(outcome.notes, [](const Note& n) { return n.code == kRebuiltAtlasNote; });
  outcome.notes.insert(outcome.notes.end(), notes.begin(), notes.end());
  outcome.files = source.files();
  outcome.keys = graph->keys();
  outcome.keys.merge(chooser.keys);
  if (request.strict) refuse_warnings(outcome.notes, request.input);
  if (request.output.empty()) return outcome;
  outcome.unchanged = file_holds(request.output, *package);
  if (!outcome.unchanged) write_output_file(request.output, *package, request.temporary);
  return outcome;
}

}  // namespace

/// A bound from below: of ten million triangles scale space takes 427 bytes each, of 500,000 simplification
/// 520.
std::uint64_t least_memory_bytes(std::uint64_t triangles) {
  constexpr std::uint64_t kPerTriangle = 400;
  return kPerTriangle * triangles;
}

CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer) {
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  try {
    return compile_source(request, options, source, store, context, observer);
  } catch (...) {
    if (request.files_of_failure) request.files_of_failure(source.files());
    throw;
  }
}

void run_towards(const CompileRequest& request, Stage last, Store& store, const RunContext& context,
                 const StageObserver& observer, const std::function<void(GraphRun&)>& use) {
  ModelSource source(request);
  source.open(store, context, true);
  Notes unused;
  const CompileOptions resolved = resolve_options(request.options);
  AtlasChooser chooser(resolved, source, store, context);
  const CompileOptions options = chooser.choose({}, {}, observer, unused);
  ModelGraph graph(source, graph_towards(std::move(last), options), options, chooser.store(), context,
                   observer);
  use(*graph);
}

std::vector<StageForecast> forecast_model(const CompileRequest& request, Store& store,
                                          const RunContext& context) {
  const CompileOptions resolved = resolve_options(request.options);
  ModelSource source(request);
  source.open(store, context, false);
  const auto forecasts_of = [&](std::vector<Stage> stages, const CompileOptions& options) {
    ModelGraph graph(source, std::move(stages), options, store, context, {});
    graph->explain(request.earlier_keys, {});
    std::vector<StageForecast> forecasts;
    for (auto& [stage, explanation] : graph->forecast())
      forecasts.push_back({stage->name, std::move(explanation)});
    return forecasts;
  };
  AtlasChooser chooser(resolved, source, store, context);
  // Before auto's choice is in the store nobody knows what follows.
  for (const AtlasMode mode : {AtlasMode::kKeep, AtlasMode::kRebuild}) {
    if (!chooser.is_open()) break;
    const CompileOptions looked_at = options_with_atlas(resolved, mode);
    std::vector<StageForecast> forecasts =
        forecasts_of(graph_towards(atlas_choice_stage(looked_at), looked_at), looked_at);
    for (const StageForecast& f : forecasts)
      if (f.explanation.verdict != StageVerdict::kHit) return forecasts;
    if (!chooser.sample(mode, {}, {}, {}).good.empty()) break;
  }
  Notes unused;
  const CompileOptions options = with_archived_notes(chooser.choose({}, {}, {}, unused), source, unused);
  return forecasts_of(stage_table(options), options);
}

}  // namespace texmesh
