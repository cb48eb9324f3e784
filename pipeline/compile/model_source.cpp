#include "pipeline/compile/model_source.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/resource_error.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

std::uint64_t machine_memory_bytes() {
  const long pages = ::sysconf(_SC_PHYS_PAGES), page = ::sysconf(_SC_PAGESIZE);
  return pages > 0 && page > 0 ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page)
                               : ~std::uint64_t{0};
}

std::string lower_extension(const fs::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return std::tolower(c); });
  return e;
}

Json to_json(const std::vector<FileRequest>& requests) {
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

/// Before work begins, instead of after minutes of it.
void refuse_too_large(const std::string& name, const Bytes& bytes, std::uint64_t limit_bytes) {
  const std::uint64_t machine = machine_memory_bytes();
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

}  // namespace

/// A bound from below: of ten million triangles scale space takes 427 bytes each, of 500,000 simplification
/// 520.
std::uint64_t least_memory_bytes(std::uint64_t triangles) {
  constexpr std::uint64_t kPerTriangle = 400;
  return kPerTriangle * triangles;
}

ModelSource::ModelSource(const CompileRequest& request)
    : path_(request.input),
      options_(request.options.import),
      memory_bytes_(request.memory_bytes),
      known_(request.known) {}

void ModelSource::open(Store& store, const RunContext& context, bool may_write_notes) {
  look_at_model();
  const Sha256 note_key = list_key();
  if (const auto note = store.find_note(note_key); note && unchanged_since(*note)) return;
  imported_ = std::make_shared<ImportedModel>(import(options_, context, requests_));
  if (may_write_notes) store.put_note(note_key, to_json(requests_).dump());
}

std::vector<std::pair<std::string, std::string>> ModelSource::parts() const {
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

Source ModelSource::source() {
  return {[this](const ImportOptions& options, const RunContext& context) {
    if (imported_) return std::move(*std::exchange(imported_, nullptr));
    std::vector<FileRequest> again;
    ImportedModel model = import(options, context, again);
    if (to_json(again) != to_json(requests_))
      throw InputError(path_.filename().string(), "", "files that stay as they are while they are compiled",
                       "one that has changed meanwhile");
    return model;
  }};
}

Json ModelSource::inputs() const {
  Json list = Json::array({{{"role", "model"}, {"sha256", to_hex(main_.digest)}, {"bytes", main_.bytes}}});
  for (const FileRequest& r : requests_)
    if (r.found)
      list.push_back({{"role", "file"},
                      {"uri", readable_name(r.uri)},
                      {"sha256", to_hex(r.digest)},
                      {"bytes", r.bytes}});
  return list;
}

std::vector<FileRequest> ModelSource::files() const {
  std::vector<FileRequest> all;
  if (main_.found) all.push_back(main_);
  all.insert(all.end(), requests_.begin(), requests_.end());
  return all;
}

void ModelSource::look_at_model() {
  const auto stamp = stamp_of(path_.string());
  for (const FileRequest& r : known_)
    if (r.uri.empty() && r.found && stamp && *stamp == r.stamp) {
      main_ = r;
      return;
    }
  read_model();
}

void ModelSource::read_model() {
  FileStamp stamp;
  bytes_ = read_input_file(path_, static_cast<std::uint64_t>(options_.max_file_bytes), &stamp);
  has_bytes_ = true;
  const FileRequest found{"", true, sha256(bytes_), bytes_.size(), stamp};
  if (main_.found && (found.digest != main_.digest || found.bytes != main_.bytes))
    throw InputError(path_.filename().string(), "", "a file that stays as it is while it is compiled",
                     "one that has changed meanwhile");
  main_ = found;
}

/// A file of a gigabyte need not wait for the package. Whoever needs it again reads it again.
void ModelSource::forget_bytes() {
  bytes_ = {};
  has_bytes_ = false;
}

Sha256 ModelSource::list_key() const {
  Key key("import-files", kImportVersion);
  key.add("extension", lower_extension(path_));
  key.add_input("model", main_.digest, main_.bytes);
  OptionTexts texts;
  append_field_texts("import", options_, texts);
  for (auto& [path, text] : texts) key.add(std::move(path), std::move(text));
  return key.digest();
}

bool ModelSource::unchanged_since(const std::string& note) {
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

ImportedModel ModelSource::import(const ImportOptions& options, const RunContext& context,
                                  std::vector<FileRequest>& requests) {
  if (!has_bytes_) read_model();
  FileResolver resolver(path_.parent_path());
  try {
    refuse_too_large(path_.filename().string(), bytes_, memory_bytes_);
    ImportedModel m = import_model(path_.filename().string(), bytes_, resolver, options, context);
    requests = resolver.requests();
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

}  // namespace texmesh
