#include "pipeline/collection.h"

#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <set>

#include "format/errors.h"
#include "pipeline/inspect/bounded_json.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxFileBytes = 256u << 20, kMaxModels = 1'000'000, kMaxPathBytes = 1000;

class CollectionReader {
 public:
  CollectionReader(const std::string& file, const CompileOptions& base) : file_(file), options_(base) {}

  std::vector<CollectionModel> read(const Json& root) {
    check_members(root, "", {"$schema", "version", "options", "models"});
    if (!root.contains("version") || root["version"] != 1)
      fail("/version", "1", root.contains("version") ? root["version"].dump() : "nothing");
    if (root.contains("options")) apply(options_, root["options"], "/options");
    if (!root.contains("models") || !root["models"].is_array() || root["models"].empty() ||
        root["models"].size() > kMaxModels)
      fail("/models", "a list of 1 to " + std::to_string(kMaxModels) + " models",
           root.contains("models") ? root["models"].type_name() : "nothing");
    std::vector<CollectionModel> models;
    for (std::size_t i = 0; i < root["models"].size(); ++i)
      models.push_back(read_model(root["models"][i], "/models/" + std::to_string(i)));
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

  CollectionModel read_model(const Json& json, const std::string& place) {
    namespace fs = std::filesystem;
    check_members(json, place, {"input", "output", "options"});
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
    m.options = options_;
    if (json.contains("options")) apply(m.options, json["options"], place + "/options");
    return m;
  }

  const std::string& file_;
  CompileOptions options_;
  std::set<std::string> outputs_;
};

}  // namespace

std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base) {
  if (json.size() > kMaxFileBytes)
    throw InputError(file_name, "", "at most 256 MiB", std::to_string(json.size()) + " bytes");
  try {
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(json.data()), json.size());
    return CollectionReader(file_name, base).read(parse_bounded_json(bytes, file_name, 16));
  } catch (const FormatError& e) {
    throw InputError(file_name, e.place(), e.expected(), e.found());
  }
}

}  // namespace texmesh
