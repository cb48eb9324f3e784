#include "pipeline/compile/compile_model.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/container/format_version.h"
#include "pipeline/compile/library_versions.h"
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

  void open(const CompileOptions& options, Store& store, const RunContext& context, bool may_write_notes) {
    look_at_model();
    const Sha256 note_key = list_key(options);
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
    std::vector<std::pair<std::string, std::string>> parts = key.parts();
    parts.erase(parts.begin(), parts.begin() + 3);  // schema, stage and version are the reading stage's own
    return parts;
  }
  Sha256 digest() const { return digest_of_parts(parts()); }

  Source source() {
    return {[this](const RunContext& context) {
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

  Sha256 list_key(const CompileOptions& options) const {
    Key key("import-files", kImportVersion);
    key.add("extension", lower_extension(path_));
    key.add_input("model", main_.digest, main_.bytes);
    CompileOptions copy = options;
    for (const OptionField& f : list_options(copy))
      if (f.stage == "import") key.add(f.path(), option_text(f));
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
  for (const Stage& s : stage_table())
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

void give_inputs(GraphRun& graph, ModelSource& source, const std::string& provenance_json) {
  graph.give("source", object(source.source()), source.digest(), 0, source.parts());
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(provenance_json.data()),
                        provenance_json.size());
  graph.give("provenance", object(provenance_json), sha256(bytes), provenance_json.size());
}

CompileOutcome run_graph(const CompileRequest& request, ModelSource& source, Store& store,
                         const RunContext& context, const StageObserver& observer) {
  GraphRun graph(stage_table(), request.options, store, context, observer);
  give_inputs(graph, source, provenance(source, request.options));
  graph.explain(request.earlier_keys, request.explainer);
  const Object package = graph.run("package");
  const auto& bytes = *static_cast<const std::vector<std::uint8_t>*>(package.get());

  CompileOutcome outcome;
  outcome.package_bytes = bytes.size();
  outcome.package_digest = sha256(bytes);
  outcome.notes = graph.notes();
  outcome.files = source.files();
  outcome.keys = graph.keys();
  if (request.strict) refuse_warnings(outcome.notes, request.input);
  if (request.output.empty()) return outcome;
  outcome.unchanged = file_holds(request.output, bytes);
  if (!outcome.unchanged) write_output_file(request.output, bytes, request.temporary);
  return outcome;
}

}  // namespace

CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer) {
  ModelSource source(request);
  try {
    source.open(request.options, store, context, true);
    return run_graph(request, source, store, context, observer);
  } catch (...) {
    if (request.files_of_failure) request.files_of_failure(source.files());
    throw;
  }
}

Object run_stages(const CompileRequest& request, const std::vector<Stage>& stages, const std::string& wanted,
                  Store& store, const RunContext& context, const StageObserver& observer, Notes& notes) {
  ModelSource source(request);
  source.open(request.options, store, context, true);
  GraphRun graph(stages, request.options, store, context, observer);
  give_inputs(graph, source, provenance(source, request.options));
  Object result = graph.run(wanted);
  notes = graph.notes();
  return result;
}

std::vector<std::pair<const Stage*, StageExplanation>> forecast_model(const CompileRequest& request,
                                                                      Store& store,
                                                                      const RunContext& context) {
  ModelSource source(request);
  source.open(request.options, store, context, false);
  GraphRun graph(stage_table(), request.options, store, context, {});
  give_inputs(graph, source, provenance(source, request.options));
  graph.explain(request.earlier_keys, {});
  return graph.forecast();
}

}  // namespace texmesh
