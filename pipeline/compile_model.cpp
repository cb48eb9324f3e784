#include "pipeline/compile_model.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/manifest.h"
#include "pipeline/atomic_file.h"
#include "pipeline/file_resolver.h"
#include "pipeline/library_versions.h"

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
    list.push_back({{"uri", r.uri}, {"found", r.found}, {"sha256", to_hex(r.digest)}, {"bytes", r.bytes}});
  return list;
}

std::optional<std::vector<std::string>> uris_of(const std::string& note) {
  const Json list = Json::parse(note, nullptr, false);
  if (!list.is_array()) return std::nullopt;
  std::vector<std::string> uris;
  for (const Json& r : list) {
    if (!r.is_object() || !r.contains("uri") || !r["uri"].is_string()) return std::nullopt;
    uris.push_back(r["uri"].get<std::string>());
  }
  return uris;
}

/// The model file with the files it refers to. Which those are is known only after an import, so the store
/// remembers the list of the last one (as ccache's manifest does): while every file on it reads as it did,
/// import need not run.
class ModelSource {
 public:
  ModelSource(const CompileRequest& request, Store& store, const RunContext& context)
      : path_(request.input), options_(request.options.import) {
    bytes_ = read_input_file(path_, static_cast<std::uint64_t>(options_.max_file_bytes));
    main_digest_ = sha256(bytes_);
    const Sha256 note_key = list_key(request.options);
    if (const auto note = store.find_note(note_key); note && unchanged_since(*note)) return;
    imported_ = std::make_shared<ImportedModel>(import(context, requests_));
    store.put_note(note_key, to_json(requests_).dump());
  }

  Sha256 digest() const {
    Key key("source", 1);
    key.add("extension", lower_extension(path_));
    key.add_input("model", main_digest_, bytes_.size());
    key.add("files", to_json(requests_).dump());
    return key.digest();
  }

  Source source() {
    return {[this](const RunContext& context) {
      if (imported_) return std::move(*std::exchange(imported_, nullptr));
      Requests again;
      return import(context, again);
    }};
  }

  /// Input digests for provenance: the model's own references, never the paths of this machine.
  Json inputs() const {
    Json list =
        Json::array({{{"role", "model"}, {"sha256", to_hex(main_digest_)}, {"bytes", bytes_.size()}}});
    for (const FileRequest& r : requests_)
      if (r.found)
        list.push_back({{"role", "file"}, {"uri", r.uri}, {"sha256", to_hex(r.digest)}, {"bytes", r.bytes}});
    return list;
  }

 private:
  Sha256 list_key(const CompileOptions& options) const {
    Key key("import-files", kImportVersion);
    key.add("extension", lower_extension(path_));
    key.add_input("model", main_digest_, bytes_.size());
    CompileOptions copy = options;
    for (const OptionField& f : list_options(copy))
      if (f.stage == "import") key.add(f.path(), option_text(f));
    return key.digest();
  }

  bool unchanged_since(const std::string& note) {
    const auto uris = uris_of(note);
    if (!uris) return false;
    FileResolver resolver(path_.parent_path());
    for (const std::string& uri : *uris) {
      try {
        resolver.read(uri, static_cast<std::uint64_t>(options_.max_file_bytes));
      } catch (const InputError&) {
        return false;  // the import itself must say what is wrong
      }
    }
    if (to_json(resolver.requests()).dump() != note) return false;
    requests_ = resolver.requests();
    return true;
  }

  ImportedModel import(const RunContext& context, Requests& requests) const {
    FileResolver resolver(path_.parent_path());
    ImportedModel m = import_model(path_.filename().string(), bytes_, resolver, options_, context);
    requests = resolver.requests();
    return m;
  }

  fs::path path_;
  ImportOptions options_;
  std::vector<std::uint8_t> bytes_;
  Sha256 main_digest_{};
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

}  // namespace

Object run_stages(const CompileRequest& request, const std::vector<Stage>& stages, const std::string& wanted,
                  Store& store, const RunContext& context, const StageObserver& observer, Notes& notes) {
  ModelSource source(request, store, context);
  const std::string provenance_json = provenance(source, request.options);

  GraphRun graph(stages, request.options, store, context, observer);
  graph.give("source", object(source.source()), source.digest(), 0);
  const std::span provenance_bytes(reinterpret_cast<const std::uint8_t*>(provenance_json.data()),
                                   provenance_json.size());
  graph.give("provenance", object(provenance_json), sha256(provenance_bytes), provenance_json.size());
  Object result = graph.run(wanted);
  notes = graph.notes();
  return result;
}

CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer) {
  CompileOutcome outcome;
  const Object package =
      run_stages(request, stage_table(), "package", store, context, observer, outcome.notes);
  const auto& bytes = *static_cast<const std::vector<std::uint8_t>*>(package.get());

  outcome.package_bytes = bytes.size();
  if (request.strict) refuse_warnings(outcome.notes, request.input);
  if (request.output.empty()) return outcome;
  outcome.unchanged = file_holds(request.output, bytes);
  if (!outcome.unchanged) write_file_atomically(request.output, bytes, request.temporary);
  return outcome;
}

}  // namespace texmesh
