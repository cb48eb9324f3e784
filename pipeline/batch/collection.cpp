#include "pipeline/batch/collection.h"

#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/about/meta.h"
#include "pipeline/batch/find_models.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/profile.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxFileBytes = 256u << 20, kMaxModels = 1'000'000, kMaxPathBytes = 1000;

class CollectionReader {
 public:
  CollectionReader(const std::string& file, const CompileOptions& base, const FolderLister& list_folder)
      : file_(file), list_folder_(list_folder), options_(base) {}

  std::vector<CollectionModel> read(const Json& root) {
    check_members(root, "", {"$schema", "version", "options", "about", "patterns", "models", "folders"});
    if (!root.contains("version") || root["version"] != 1)
      fail("/version", "1", root.contains("version") ? root["version"].dump() : "nothing");
    apply_members(options_, root, "");
    read_patterns(root);
    const bool has_folders = root.contains("folders");
    if (!root.contains("models") && !has_folders) fail("/models", "models or folders", "nothing");
    std::vector<CollectionModel> models;
    if (root.contains("models")) {
      check_list(root["models"], "/models", "models");
      for (std::size_t i = 0; i < root["models"].size(); ++i)
        models.push_back(read_model(root["models"][i], "/models/" + std::to_string(i)));
    }
    if (has_folders) read_folders(root["folders"], models);
    return models;
  }

 private:
  [[noreturn]] void fail(const std::string& place, const std::string& expected,
                         const std::string& found) const {
    throw InputError(file_, place, expected, found.substr(0, 120));
  }

  void check_members(const Json& object, const std::string& place,
                     std::initializer_list<std::string_view> known) const {
    if (!object.is_object()) fail(place, "an object", object.type_name());
    for (const auto& [name, value] : object.items())
      if (std::find(known.begin(), known.end(), name) == known.end())
        fail(place + "/" + name, "a known field", "\"" + name + "\"");
  }

  std::string path_at(const Json& object, const char* key, const std::string& place) const {
    const Json& v = object[key];
    if (!v.is_string() || v.get_ref<const std::string&>().empty() ||
        v.get_ref<const std::string&>().size() > kMaxPathBytes)
      fail(place + "/" + key, "a path of 1 to " + std::to_string(kMaxPathBytes) + " bytes", v.dump());
    for (const char c : v.get_ref<const std::string&>())
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
        fail(place + "/" + key, "a path without control characters", v.dump());
    return v.get<std::string>();
  }

  void apply(CompileOptions& options, const Json& body, const std::string& place) const {
    if (!body.is_object()) fail(place, "an object", body.type_name());
    if (body.contains("version"))
      fail(place + "/version", "no version, the collection has one", body["version"].dump());
    Json profile = body;
    profile["version"] = 1;
    try {
      read_profile(options, profile.dump(), file_);
    } catch (const InputError& e) {
      throw InputError(file_, place + e.place(), e.expected(), e.found());
    }
  }

  /// `options` and `about` of the collection, a pattern or a model.
  void apply_members(CompileOptions& options, const Json& object, const std::string& place) const {
    if (object.contains("options")) apply(options, object["options"], place + "/options");
    if (!object.contains("about")) return;
    const std::string meta = read_meta(object["about"].dump(), file_, place + "/about");
    options.package.meta = merge_meta(options.package.meta, meta);
  }

  void check_list(const Json& list, const std::string& place, const std::string& what) const {
    if (!list.is_array() || list.empty() || list.size() > kMaxModels)
      fail(place, "a list of 1 to " + std::to_string(kMaxModels) + " " + what, list.type_name());
  }

  void read_patterns(const Json& root) {
    if (!root.contains("patterns")) return;
    const Json& list = root["patterns"];
    check_list(list, "/patterns", "patterns");
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string place = "/patterns/" + std::to_string(i);
      check_members(list[i], place, {"match", "options", "about"});
      if (!list[i].contains("match")) fail(place + "/match", "a pattern", "nothing");
      if (!list[i].contains("options") && !list[i].contains("about"))
        fail(place + "/options", "options or about", "nothing");
      patterns_.push_back({path_at(list[i], "match", place), list[i], place});
      CompileOptions check = options_;  // wrong options are an error even where nothing matches
      apply_members(check, list[i], place);
    }
  }

  /// Options of the models that the same patterns match, made once.
  std::shared_ptr<const CompileOptions> options_for(const std::string& input) {
    std::vector<bool> matches;
    for (const Pattern& p : patterns_) matches.push_back(::fnmatch(p.match.c_str(), input.c_str(), 0) == 0);
    auto& shared = shared_[matches];
    if (!shared) {
      CompileOptions options = options_;
      for (std::size_t i = 0; i < patterns_.size(); ++i)
        if (matches[i]) apply_members(options, patterns_[i].json, patterns_[i].place);
      shared = std::make_shared<const CompileOptions>(std::move(options));
    }
    return shared;
  }

  /// Folders give what the list does not name already; a model keeps its place in the folder.
  void read_folders(const Json& folders, std::vector<CollectionModel>& models) {
    namespace fs = std::filesystem;
    check_list(folders, "/folders", "folders");
    std::set<std::string> listed;
    for (const CollectionModel& m : models) listed.insert(fs::path(m.input).lexically_normal().string());
    for (std::size_t i = 0; i < folders.size(); ++i) {
      const std::string place = "/folders/" + std::to_string(i);
      if (!folders[i].is_string() || folders[i].get_ref<const std::string&>().empty())
        fail(place, "a path", folders[i].dump());
      const std::string folder = folders[i].get<std::string>();
      if (!list_folder_) continue;
      const std::vector<std::string> found = list_folder_(folder);
      std::map<std::string, std::pair<int, int>> sharing;  // files, those that are no .json
      const auto package_of = [](const std::string& relative) {
        return fs::path(relative).replace_extension(".texmesh").string();
      };
      for (const std::string& relative : found) {
        auto& [files, others] = sharing[package_of(relative)];
        ++files, others += is_json(relative) ? 0 : 1;
      }
      for (const std::string& relative : found) {
        const std::string input = (fs::path(folder) / relative).string();
        if (!listed.insert(fs::path(input).lexically_normal().string()).second) continue;
        const std::string package = package_of(relative);
        const bool unread = is_json(relative);
        const auto [files, others] = sharing[package];
        const bool longer = unread ? files > 1 : others > 1;
        add(models, {input, longer ? relative + ".texmesh" : package, options_for(input), unread}, place);
      }
    }
  }

  void add(std::vector<CollectionModel>& models, CollectionModel model, const std::string& place) {
    if (models.size() >= kMaxModels) fail(place, "at most " + std::to_string(kMaxModels) + " models", "more");
    if (!model.unread &&
        !outputs_.insert(std::filesystem::path(model.output).lexically_normal().string()).second)
      fail(place, "an output of its own for " + model.input, model.output + ", as another model");
    models.push_back(std::move(model));
  }

  CollectionModel read_model(const Json& json, const std::string& place) {
    namespace fs = std::filesystem;
    check_members(json, place, {"input", "output", "options", "about"});
    if (!json.contains("input")) fail(place + "/input", "a path", "nothing");
    CollectionModel m;
    m.input = path_at(json, "input", place);
    m.output = json.contains("output") ? path_at(json, "output", place)
                                       : fs::path(m.input).filename().replace_extension(".texmesh").string();
    const fs::path output(m.output);
    bool beneath = output.is_relative() && output.extension() == ".texmesh";
    for (const fs::path& part : output) beneath = beneath && part != "..";
    if (!beneath)
      fail(place + "/output", "a path beneath the output folder that ends with .texmesh", m.output);
    if (!outputs_.insert(output.lexically_normal().string()).second)
      fail(place + "/output", "an output of its own", m.output + ", as another model");
    m.options = options_for(m.input);
    if (json.contains("options") || json.contains("about")) {
      CompileOptions with_changes = *m.options;
      apply_members(with_changes, json, place);
      m.options = std::make_shared<const CompileOptions>(std::move(with_changes));
    }
    return m;
  }

  struct Pattern {
    std::string match;
    Json json;  // with options or about
    std::string place;
  };
  const std::string& file_;
  const FolderLister& list_folder_;
  CompileOptions options_;
  std::vector<Pattern> patterns_;
  std::map<std::vector<bool>, std::shared_ptr<const CompileOptions>> shared_;
  std::set<std::string> outputs_;
};

}  // namespace

std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base, const FolderLister& list_folder) {
  if (json.size() > kMaxFileBytes)
    throw InputError(file_name, "", "at most 256 MiB", std::to_string(json.size()) + " bytes");
  try {
    const auto bytes = text_bytes(json);
    return CollectionReader(file_name, base, list_folder).read(parse_bounded_json(bytes, file_name, 16));
  } catch (const FormatError& e) {
    throw InputError(file_name, e.place(), e.expected(), e.found());
  }
}

}  // namespace texmesh
