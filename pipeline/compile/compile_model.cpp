#include "pipeline/compile/compile_model.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/container/format_version.h"
#include "pipeline/compile/artefacts.h"
#include "pipeline/compile/library_versions.h"
#include "pipeline/compile/profile.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/resource_error.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;
using Requests = std::vector<FileRequest>;

std::string lower_extension(const fs::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return std::tolower(c); });
  return e;
}

Json to_json(const Requests& requests) {
  Json list = Json::array();
  for (const FileRequest& r : requests)
    list.push_back(
        {{"uri", to_wire(r.uri)}, {"found", r.found}, {"sha256", to_hex(r.digest)}, {"bytes", r.bytes}});
  return list;
}

std::optional<std::vector<std::string>> uris_of(const std::string& note) {
  const Json list = Json::parse(note, nullptr, false);
  if (!list.is_array()) return std::nullopt;
  std::vector<std::string> uris;
  for (const Json& r : list) {
    if (!r.is_object() || !r.contains("uri") || !r["uri"].is_string()) return std::nullopt;
    uris.push_back(from_wire(r["uri"].get<std::string>()));
  }
  return uris;
}

/// The model file with the files it refers to. Which those are is known only after an import, so the store
/// remembers the list of the last one (as ccache's manifest does): while every file on it reads as it did,
/// import need not run.
class ModelSource {
 public:
  explicit ModelSource(const CompileRequest& request)
      : path_(request.input), options_(request.options.import), known_(request.known) {}

  void open(Store& store, const RunContext& context, bool may_write_notes) {
    look_at_model();
    const Sha256 note_key = list_key();
    if (const auto note = store.find_note(note_key); note && unchanged_since(*note)) return;
    imported_ = std::make_shared<ImportedModel>(import(context, requests_));
    if (may_write_notes) store.put_note(note_key, to_json(requests_).dump());
  }

  /// What the model is made of: its own bytes, and every file that it asked for, found or not.
  std::vector<std::pair<std::string, std::string>> parts() const {
    Key key("source", 1);
    key.add("extension", lower_extension(path_));
    key.add_input("model", main_.digest, main_.bytes);
    for (const FileRequest& r : requests_)
      if (r.found)
        key.add_input("file " + to_wire(r.uri), r.digest, r.bytes);
      else
        key.add("input file " + to_wire(r.uri), "not there");
    return key.added_parts();
  }
  Sha256 digest() const { return digest_of_parts(parts()); }

  Source source() {
    return {[this](const ImportOptions&, const RunContext& context) {
      if (imported_) return std::move(*std::exchange(imported_, nullptr));
      Requests again;
      ImportedModel model = import(context, again);
      if (to_json(again) != to_json(requests_))
        throw InputError(path_.filename().string(), "", "files that stay as they are while they are compiled",
                         "one that has changed meanwhile");
      return model;
    }};
  }

  /// Input digests for provenance: the model's own references, never the paths of this machine.
  Json inputs() const {
    Json list = Json::array({{{"role", "model"}, {"sha256", to_hex(main_.digest)}, {"bytes", main_.bytes}}});
    for (const FileRequest& r : requests_)
      if (r.found)
        list.push_back({{"role", "file"},
                        {"uri", readable_name(r.uri)},
                        {"sha256", to_hex(r.digest)},
                        {"bytes", r.bytes}});
    return list;
  }

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

  void read_model() {
    FileStamp stamp;
    bytes_ = read_input_file(path_, static_cast<std::uint64_t>(options_.max_file_bytes), &stamp);
    has_bytes_ = true;
    const FileRequest found{"", true, sha256(bytes_), bytes_.size(), stamp};
    if (main_.found && (found.digest != main_.digest || found.bytes != main_.bytes))
      throw InputError(path_.filename().string(), "", "a file that stays as it is while it is compiled",
                       "one that has changed meanwhile");
    main_ = found;
  }

  Sha256 list_key() const {
    Key key("import-files", kImportVersion);
    key.add("extension", lower_extension(path_));
    key.add_input("model", main_.digest, main_.bytes);
    OptionTexts texts;
    append_field_texts("import", options_, texts);
    for (auto& [path, text] : texts) key.add(std::move(path), std::move(text));
    return key.digest();
  }

  bool unchanged_since(const std::string& note) {
    const auto uris = uris_of(note);
    if (!uris) return false;
    FileResolver resolver(path_.parent_path());
    resolver.expect(known_);
    for (const std::string& uri : *uris) {
      try {
        resolver.look(uri, static_cast<std::uint64_t>(options_.max_file_bytes));
      } catch (const InputError&) {
        return false;  // the import itself must say what is wrong
      }
    }
    if (to_json(resolver.requests()).dump() != note) return false;
    requests_ = resolver.requests();
    return true;
  }

  ImportedModel import(const RunContext& context, Requests& requests) {
    if (!has_bytes_) read_model();
    FileResolver resolver(path_.parent_path());
    try {
      ImportedModel m = import_model(path_.filename().string(), bytes_, resolver, options_, context);
      requests = resolver.requests();
      return m;
    } catch (const InputError& e) {
      requests = resolver.requests();
      if (resolver.failed_for_resources()) throw ResourceError(e.file(), e.place(), e.expected(), e.found());
      throw;
    } catch (...) {
      requests = resolver.requests();  // what a failure depends on, too
      throw;
    }
  }

  fs::path path_;
  ImportOptions options_;
  std::vector<FileRequest> known_;
  std::vector<std::uint8_t> bytes_;
  bool has_bytes_ = false;
  FileRequest main_;
  Requests requests_;
  std::shared_ptr<ImportedModel> imported_;
};

/// What made the package, without dates, hosts or paths.
std::string provenance(const ModelSource& source, const CompileOptions& options) {
  Json stages = Json::object(), libraries = Json::object();
  for (const Stage& s : default_stage_table())
    if (s.stored) stages[s.name] = s.version;
  for (const auto& [name, version] : library_versions()) libraries[name] = version;
  return Json{{"version", 1},
              {"tool", "texmesh " + tool_version()},
              {"format", {{"major", kFormatMajor}, {"minor", kFormatMinor}}},
              {"inputs", source.inputs()},
              {"options", Json::parse(write_profile(options))},
              {"stages", stages},
              {"libraries", libraries}}
      .dump();
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
    graph_.give(kProvenance, json, sha256({reinterpret_cast<const std::uint8_t*>(json.data()), json.size()}),
                json.size());
  }
  GraphRun& operator*() { return graph_; }
  GraphRun* operator->() { return &graph_; }

 private:
  std::vector<Stage> stages_;
  GraphRun graph_;  // refers to stages_, which therefore stands first
};

CompileOutcome compile_source(const CompileRequest& request, const CompileOptions& options,
                              ModelSource& source, Store& store, const RunContext& context,
                              const StageObserver& observer) {
  source.open(store, context, true);
  ModelGraph graph(source, stage_table(options), options, store, context, observer);
  graph->explain(request.earlier_keys, request.explainer);
  const std::shared_ptr<const Bytes> package = graph->run(kPackage);

  CompileOutcome outcome;
  outcome.package_bytes = package->size();
  outcome.package_digest = sha256(*package);
  outcome.notes = graph->notes();
  outcome.files = source.files();
  outcome.keys = graph->keys();
  if (request.strict) refuse_warnings(outcome.notes, request.input);
  if (request.output.empty()) return outcome;
  outcome.unchanged = file_holds(request.output, *package);
  if (!outcome.unchanged) write_output_file(request.output, *package, request.temporary);
  return outcome;
}

}  // namespace

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
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  source.open(store, context, true);
  ModelGraph graph(source, graph_towards(std::move(last), options), options, store, context, observer);
  use(*graph);
}

std::vector<StageForecast> forecast_model(const CompileRequest& request, Store& store,
                                          const RunContext& context) {
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  source.open(store, context, false);
  ModelGraph graph(source, stage_table(options), options, store, context, {});
  graph->explain(request.earlier_keys, {});
  std::vector<StageForecast> forecasts;
  for (auto& [stage, explanation] : graph->forecast())
    forecasts.push_back({stage->name, std::move(explanation)});
  return forecasts;
}

}  // namespace texmesh
