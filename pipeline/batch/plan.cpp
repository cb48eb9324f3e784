// Which models a run compiles, and with which options: those that it is given, those beneath folders, those
// of collections; then the part of them that is one shard's.
#include "pipeline/batch/plan.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <queue>

#include "format/base/text_bytes.h"
#include "pipeline/about/source_annotations.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/batch/stale_packages.h"
#include "pipeline/compile/options.h"
#include "pipeline/import/archive/archive_files.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

bool may_be_model(const std::string& path) {
  const std::string e = lower_ending(path);
  return e == ".glb" || e == ".gltf" || e == ".obj" || e == ".ply" || e == ".stl" || is_told_by_content(path);
}

// Texts, not fs::path: taking a thousand paths apart again and again took a sixth of a run that does nothing.
struct Found {
  std::string path;
  std::size_t relative = 0;  // where the path within the input begins
  bool unread = false;
};

/// The order of fs::path: by parts, so that a folder's files stand together.
bool path_less(std::string_view a, std::string_view b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    const auto rank = [](char c) { return c == '/' ? 0 : static_cast<unsigned char>(c) + 1; };
    return rank(x) < rank(y);
  });
}

std::size_t prefix_bytes(const std::string& folder) {
  return folder.size() + (folder.ends_with('/') ? 0 : 1);
}

constexpr const char* kCollectionName = "collection.json";  // as the documents call it

/// By its name: a scan in a format that texmesh does not read.
bool is_other_model(const std::string& path) {
  static constexpr std::string_view kEndings[] = {".3ds",  ".abc",  ".blend", ".dae", ".e57", ".fbx", ".las",
                                                  ".laz",  ".max",  ".ma",    ".mb",  ".off", ".usd", ".usda",
                                                  ".usdc", ".usdz", ".vrml",  ".wrl", ".x3d"};
  return std::ranges::find(kEndings, lower_ending(path)) != std::end(kEndings);
}

[[noreturn]] void fail_listing(const std::string& path, const std::error_code& ec) {
  const std::string found = "cannot be listed: " + ec.message();
  if (ec == std::errc::permission_denied) throw PermissionError(path, "", "", found);
  throw InputError(path, "", "", found);
}

/// Paths as this process can open them, in the order of list_models().
std::vector<std::string> model_paths(const std::string& folder, Notes* notes) {
  std::error_code ec;
  fs::recursive_directory_iterator it(folder, ec), end;
  if (ec) fail_listing(folder, ec);
  std::vector<std::string> models, others;
  while (it != end) {
    std::string path = it->path().string();
    if (it->path().filename().string().front() == '.' || (it->is_directory(ec) && is_made_folder(it->path())))
      it.disable_recursion_pending();
    else if (it->is_regular_file(ec) && may_be_model(path))
      models.push_back(path);
    else if (is_other_model(path))
      others.push_back(path.substr(prefix_bytes(folder)));
    it.increment(ec);  // a folder that is left out without a word is a collection without its models
    if (ec) fail_listing(path, ec);
  }
  std::sort(models.begin(), models.end(),
            [same = prefix_bytes(folder)](std::string_view a, std::string_view b) {
              return path_less(a.substr(same), b.substr(same));
            });
  if (std::ranges::all_of(models, is_told_by_content) && std::ranges::none_of(models, holds_model))
    throw InputError(folder, "", "a folder with models (.glb, .gltf, .obj, .ply, .stl, .zip)",
                     others.empty() ? "none" : "none, but " + *std::ranges::min_element(others));
  if (notes && !others.empty())
    notes->push_back({Severity::kWarning, "other-formats", folder,
                      fmt::format("{} of formats that texmesh does not read {} left out, {} among them",
                                  counted(others.size(), "file"), others.size() == 1 ? "is" : "are",
                                  *std::ranges::min_element(others))});
  if (notes && fs::exists(fs::path(folder) / kCollectionName, ec))
    notes->push_back({Severity::kWarning, "collection-not-read", folder,
                      fmt::format("its {0} is not read: compile {1} itself to use its titles and options",
                                  kCollectionName, (fs::path(folder) / kCollectionName).string())});
  return models;
}

/// What names of one file give on every system.
std::string output_key(const std::string& output) {
  if (std::ranges::any_of(output, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }))
    return name_key(output);
  return in_lower_case(output);  // in the place of a library's work for each of 100,000 names
}

/// The keys of outputs that more than one of the models have.
/// 8 bytes a model: a map of the outputs of 100,000 models took a sixth of a run that does nothing.
std::set<std::string> repeated_outputs(const std::vector<PlannedModel>& models) {
  const std::hash<std::string> hash;
  std::vector<std::size_t> hashes;
  hashes.reserve(models.size());
  for (const PlannedModel& m : models) hashes.push_back(hash(output_key(m.output)));
  std::sort(hashes.begin(), hashes.end());
  std::set<std::size_t> shared;
  for (auto at = hashes.begin(); (at = std::adjacent_find(at, hashes.end())) != hashes.end(); ++at)
    shared.insert(*at);
  std::set<std::string> seen, repeated;
  if (shared.empty()) return repeated;
  for (const PlannedModel& m : models)
    if (std::string key = output_key(m.output); shared.contains(hash(key)) && !seen.insert(key).second)
      repeated.insert(std::move(key));
  return repeated;
}

constexpr std::size_t kMaxFileBytes = 256u << 20, kMaxModels = 1'000'000, kMaxPathBytes = 1000;

/// The package of a model at a path within its folder.
std::string package_of(const std::string& relative, PackageNames names) {
  return names == PackageNames::kFull ? relative + ".texmesh"
                                      : fs::path(relative).replace_extension(".texmesh").string();
}

class CollectionReader {
 public:
  CollectionReader(const std::string& file, const CompileOptions& base, const FolderLister& list_folder,
                   PackageNames names, const NotesReader& read_notes, Notes* notes)
      : file_(file),
        list_folder_(list_folder),
        read_notes_(read_notes),
        names_(names),
        options_(base),
        notes_(notes) {}

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
    for (const Pattern& p : patterns_)
      if (notes_ && !p.is_used)
        notes_->push_back({Severity::kWarning, "unused-pattern", file_,
                           p.place + "/match: no model's input matches \"" + p.match + "\""});
    return models;
  }

 private:
  [[noreturn]] void fail(const std::string& place, const std::string& expected,
                         const std::string& found) const {
    throw InputError(file_, place, expected, found.substr(0, 120));
  }

  void check_members(const Json& object, const std::string& place,
                     std::initializer_list<const char*> known) const {
    if (!object.is_object()) fail(place, "an object", object.type_name());
    check_names(object, known, RecordPlace{file_, nullptr, place});
  }

  std::string path_at(const Json& object, const char* key, const std::string& place) const {
    std::string path;
    get_value(object[key], path, FieldRule{.range = Range{1, kMaxPathBytes}},
              RecordPlace{file_, nullptr, place + "/" + key});
    for (const char c : path)
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
        fail(place + "/" + key, "a path without control characters", path);
    return with_slashes(std::move(path));
  }

  static std::string with_slashes(std::string path) {
    std::replace(path.begin(), path.end(), '\\', '/');
    return path;
  }

  void apply(CompileOptions& options, const Json& body, const std::string& place) const {
    if (!body.is_object()) fail(place, "an object", body.type_name());
    if (body.contains("version"))
      fail(place + "/version", "no version, the collection has one", body["version"].dump());
    Json profile = body;
    profile["version"] = 1;
    try {
      apply_profile(options, profile, file_);
    } catch (const InputError& e) {
      std::string within = e.place();
      if (!within.starts_with('/')) within = "/" + within, std::ranges::replace(within, '.', '/');
      throw InputError(file_, place + within, e.expected(), e.found());
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
      fail(place, "a list of 1 to " + std::to_string(kMaxModels) + " " + what,
           list.is_array() ? std::to_string(list.size()) : list.type_name());
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
      patterns_.push_back({path_at(list[i], "match", place), list[i], place, false});
      CompileOptions check = options_;  // wrong options are an error even where nothing matches
      apply_members(check, list[i], place);
    }
  }

  /// Options of the models that the same patterns match, made once.
  std::shared_ptr<const CompileOptions> options_for(const std::string& input) {
    std::vector<bool> matches;
    for (Pattern& p : patterns_) {
      matches.push_back(::fnmatch(p.match.c_str(), input.c_str(), 0) == 0);
      p.is_used = p.is_used || matches.back();
    }
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
    check_list(folders, "/folders", "folders");
    std::set<std::string> listed;
    for (const CollectionModel& m : models) listed.insert(fs::path(m.input).lexically_normal().string());
    for (std::size_t i = 0; i < folders.size(); ++i) {
      const std::string place = "/folders/" + std::to_string(i);
      if (!folders[i].is_string() || folders[i].get_ref<const std::string&>().empty())
        fail(place, "a path", folders[i].dump());
      const std::string folder = with_slashes(folders[i].get<std::string>());
      if (!list_folder_) continue;
      const std::vector<std::string> found = list_folder_(folder);
      for (const std::string& relative : found) {
        const std::string input = (fs::path(folder) / relative).string();
        if (!listed.insert(fs::path(input).lexically_normal().string()).second) continue;
        add(models, {input, package_of(relative, names_), options_for(input), is_told_by_content(relative)},
            place);
      }
    }
  }

  void add(std::vector<CollectionModel>& models, CollectionModel model, const std::string& place) {
    if (models.size() >= kMaxModels) fail(place, "at most " + std::to_string(kMaxModels) + " models", "more");
    if (!model.unread) take_output(model, place, "give one of them an output in /models, or --names full");
    models.push_back(std::move(model));
  }

  void take_output(const CollectionModel& model, const std::string& place, const std::string& hint) {
    const auto [taken, fresh] =
        outputs_.emplace(output_key(fs::path(model.output).lexically_normal().string()), model.input);
    if (!fresh)
      fail(place, "an output of its own for " + model.input + " (" + hint + ")",
           model.output + ", which is that of " + taken->second);
  }

  CollectionModel read_model(const Json& json, const std::string& place) {
    check_members(json, place, {"input", "output", "options", "about", "annotations"});
    if (!json.contains("input")) fail(place + "/input", "a path", "nothing");
    CollectionModel m;
    m.input = path_at(json, "input", place);
    m.output = json.contains("output") ? path_at(json, "output", place)
                                       : package_of(fs::path(m.input).filename().string(), names_);
    const fs::path output(m.output);
    bool beneath = output.is_relative() && output.extension() == ".texmesh";
    for (const fs::path& part : output) beneath = beneath && part != "..";
    if (!beneath)
      fail(place + "/output", "a path beneath the output folder that ends with .texmesh", m.output);
    take_output(m, place + "/output", "names that differ only in case count as one");
    m.options = options_for(m.input);
    if (json.contains("options") || json.contains("about") || json.contains("annotations")) {
      CompileOptions with_changes = *m.options;
      apply_members(with_changes, json, place);
      if (const std::string file = json.contains("annotations") ? path_at(json, "annotations", place) : "";
          !file.empty() && read_notes_)
        with_changes.package.annotations = read_notes_(file);
      m.options = std::make_shared<const CompileOptions>(std::move(with_changes));
    }
    return m;
  }

  struct Pattern {
    std::string match;
    Json json;  // with options or about
    std::string place;
    bool is_used;
  };
  const std::string& file_;
  const FolderLister& list_folder_;
  const NotesReader& read_notes_;
  const PackageNames names_;
  CompileOptions options_;
  Notes* const notes_;
  std::vector<Pattern> patterns_;
  std::map<std::vector<bool>, std::shared_ptr<const CompileOptions>> shared_;
  std::map<std::string, std::string> outputs_;  // by output_key(): the model's input
};

bool is_collection(const std::string& input) {
  return fs::path(input).extension() == ".json" && fs::is_regular_file(input) && !holds_model(input);
}

/// Resolved options after the command line's flags, as text; one text for all models that share an object.
class Profiles {
 public:
  explicit Profiles(const PlanRequest& request) : request_(request) {}
  std::shared_ptr<const std::string> of(const std::shared_ptr<const CompileOptions>& options) {
    auto& text = by_options_[options.get()];
    if (!text) {
      CompileOptions all = *options;
      if (request_.apply_flags) request_.apply_flags(all);
      std::string profile = write_profile(resolve_options(std::move(all)));
      text = by_text_.try_emplace(profile, std::make_shared<const std::string>(profile)).first->second;
      kept_.push_back(options);  // so that no other object gets its address
    }
    return text;
  }

 private:
  const PlanRequest& request_;
  std::map<const CompileOptions*, std::shared_ptr<const std::string>> by_options_;
  std::map<std::string, std::shared_ptr<const std::string>> by_text_;
  std::vector<std::shared_ptr<const CompileOptions>> kept_;
};

void add_collection(const std::string& file, const PlanRequest& request, const CompileOptions& base,
                    Profiles& profiles, BatchPlan& plan) {
  const auto bytes = read_input_file(file, kMaxFileBytes);
  const fs::path folder = fs::path(file).parent_path();
  const auto list = [&](const std::string& name) {
    return list_models((folder / name).string(), &plan.notes);
  };
  plan.files.push_back(file);
  const auto read_notes = [&](const std::string& name) {
    plan.files.push_back((folder / name).string());
    return read_notes_file(plan.files.back(), plan.notes);
  };
  for (const CollectionModel& m : read_collection(std::string(bytes.begin(), bytes.end()), file, base, list,
                                                  request.names, read_notes, &plan.notes)) {
    const std::string input = (folder / m.input).string();
    plan.models.push_back({input, (fs::path(request.output) / m.output).string(), false, m.unread,
                           profiles.of(m.options), nullptr});
  }
  plan.folders.push_back((folder / "").string());
}

[[noreturn]] void refuse_package(const std::string& input, const std::string& output,
                                 const std::string& other) {
  std::error_code ec;
  if (fs::equivalent(input, other, ec))
    throw InputError(input, "", "every model once", "it twice, the other time as " + other);
  throw InputError(
      input, "",
      "a package of its own (--names full names packages by format, too; a collection.json names each)",
      output + ", which is that of " + other);
}

/// Unread files that `chosen` names leave the plan where they are no models.
template <class Chosen>
void read_unread(BatchPlan& plan, const Chosen& chosen) {
  for (PlannedModel& m : plan.models) {
    if (!m.unread || !chosen(m)) continue;
    m.unread = false;
    if (!holds_model(m.input))
      m.input.clear();
    else if (m.meets)
      refuse_package(m.input, fs::path(m.input).filename().replace_extension(".texmesh").string(), *m.meets);
  }
  std::erase_if(plan.models, [](const PlannedModel& m) { return m.input.empty(); });
}

/// The model with a package that others would have, too: by the package's key.
using Meetings = std::map<std::string, const PlannedModel*>;

/// Files that may be no models make way for those that are: a.json beside a.glb. Only the shard that has the
/// file opens it.
void set_unread_aside(BatchPlan& plan, const std::set<std::string>& shared) {
  Meetings read;
  for (const PlannedModel& m : plan.models)
    if (std::string key = output_key(m.output); !m.unread && shared.contains(key))
      read.emplace(std::move(key), &m);
  for (PlannedModel& m : plan.models) {
    const auto met = m.unread ? read.find(output_key(m.output)) : read.end();
    if (met == read.end()) continue;
    m.meets = std::make_shared<const std::string>(met->second->input);
    m.output.insert(m.output.rfind('.'), fs::path(m.input).extension().string());
  }
}

void refuse_shared_outputs(BatchPlan& plan) {
  auto shared = repeated_outputs(plan.models);
  if (shared.empty()) return;
  set_unread_aside(plan, shared);
  // The few that must be opened by every shard, such as a meta.json in each of two folders.
  shared = repeated_outputs(plan.models);
  read_unread(plan, [&](const PlannedModel& m) { return shared.contains(output_key(m.output)); });
  shared = repeated_outputs(plan.models);
  Meetings first_of;
  for (const PlannedModel& m : plan.models) {
    std::string key = output_key(m.output);
    if (!shared.contains(key)) continue;
    const auto [it, fresh] = first_of.emplace(std::move(key), &m);
    const PlannedModel& other = *it->second;
    if (!fresh && m.output == other.output) refuse_package(m.input, m.output, other.input);
    if (!fresh)
      throw InputError(
          m.input, "",
          "a package whose name differs from others not only in case (a collection.json names each)",
          m.output + " beside " + other.output + ", that of " + other.input);
  }
}

/// Costs are whole microseconds: sums of them do not depend on their order.
std::uint64_t cost_us(const PlannedModel& m, const std::string& package, const PlanRequest& request) {
  const auto known = request.costs_s.find(package);
  if (known != request.costs_s.end()) return static_cast<std::uint64_t>(known->second * 1e6);
  return static_cast<std::uint64_t>(guessed_seconds(bytes_of_file(m.input)) * 1e6);
}

void drop_other_shards(BatchPlan& plan, const PlanRequest& request) {
  const ShardSplit split = split_plan(plan, request, request.shard.count);
  plan.collection = split.collection;
  std::size_t i = 0;
  std::erase_if(plan.models, [&](const PlannedModel&) { return split.shard_of[i++] != request.shard.index; });
}

}  // namespace

std::vector<int> balance_shards(const std::vector<ModelCost>& models, int shards) {
  std::vector<std::size_t> order(models.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (models[a].cost_us != models[b].cost_us) return models[a].cost_us > models[b].cost_us;
    return models[a].name < models[b].name;
  });
  using Load = std::pair<std::uint64_t, int>;  // cost so far, shard: equal costs go to the first shard
  std::priority_queue<Load, std::vector<Load>, std::greater<>> loads;
  for (int s = 0; s < shards; ++s) loads.emplace(0, s);
  std::vector<int> shard_of(models.size());
  for (const std::size_t i : order) {
    const auto [cost, shard] = loads.top();
    loads.pop();
    shard_of[i] = shard;
    loads.emplace(cost + std::max<std::uint64_t>(models[i].cost_us, 1), shard);
  }
  return shard_of;
}

std::string collection_digest(const std::vector<ModelCost>& models) {
  std::vector<const ModelCost*> order;
  order.reserve(models.size());
  for (const ModelCost& m : models) order.push_back(&m);
  std::sort(order.begin(), order.end(),
            [](const ModelCost* a, const ModelCost* b) { return a->name < b->name; });
  std::string text;
  for (const ModelCost* m : order) {
    text += m->name;
    text += '\0' + std::to_string(m->cost_us) + '\n';
  }
  return to_hex(sha256(text_bytes(text)));
}

std::uint64_t bytes_of_file(const std::string& path) {
  std::error_code ec;
  const auto bytes = fs::file_size(path, ec);
  return ec ? 0 : bytes;
}

double guessed_seconds(std::uint64_t model_bytes) {
  constexpr double kBaseSeconds = 1, kSecondsPerByte = 5e-7;
  return kBaseSeconds + kSecondsPerByte * static_cast<double>(model_bytes);
}

bool is_told_by_content(const std::string& path) {
  const std::string ending = lower_ending(path);
  return ending == ".json" || ending == ".zip";
}

bool holds_model(const std::string& path) {
  std::error_code ec;
  if (!std::filesystem::is_regular_file(path, ec)) return false;  // to open a FIFO is to wait
  if (lower_ending(path) == ".zip") return is_archive_of_model(path);
  std::ifstream in(path, std::ios::binary);
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  return head.find("\"cylindrical-range-scan\"") != std::string::npos;
}

std::vector<std::string> list_models(const std::string& folder, Notes* notes) {
  std::vector<std::string> models = model_paths(folder, notes);
  for (std::string& path : models) path.erase(0, prefix_bytes(folder));
  return models;
}

std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output,
                                   PackageNames names, Notes* notes) {
  std::vector<Found> found;
  bool any_folder = false;
  for (const std::string& input : inputs) {
    if (fs::is_directory(input)) {
      any_folder = true;
      for (std::string& path : model_paths(input, notes)) {
        const bool unread = is_told_by_content(path);
        found.push_back({std::move(path), prefix_bytes(input), unread});
      }
    } else {
      found.push_back({input, input.size() - fs::path(input).filename().string().size()});
    }
  }
  const bool one_file = inputs.size() == 1 && !any_folder && fs::path(output).extension() == ".texmesh" &&
                        !fs::is_directory(output);
  if (one_file) return {{inputs[0], output}};
  if (fs::path(output).extension() == ".texmesh" && !fs::is_directory(output))
    throw InputError(output, "", "a folder for the packages of several models", "the name of one package");

  const std::string prefix = (fs::path(output) / "").string();
  std::vector<ModelPath> models;
  models.reserve(found.size());
  for (Found& f : found) {
    const std::size_t slash = f.path.rfind('/') + 1, dot = f.path.rfind('.');
    const bool cut =
        names == PackageNames::kStem && dot != std::string::npos && dot > std::max(slash, f.relative);
    const std::string_view relative = std::string_view(f.path).substr(f.relative);
    std::string package = prefix;
    package.reserve(prefix.size() + relative.size() + 8);  // of 100,000, what growing leaves free counts
    package.append(relative.substr(0, cut ? dot - f.relative : relative.npos)).append(".texmesh");
    models.push_back({std::move(f.path), std::move(package), f.unread});
  }
  return models;
}

std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base, const FolderLister& list_folder,
                                             PackageNames names, const NotesReader& read_notes,
                                             Notes* notes) {
  return CollectionReader(file_name, base, list_folder, names, read_notes, notes)
      .read(parse_document(text_bytes(json), kMaxFileBytes, 16, file_name));
}

BatchPlan plan_batch(const PlanRequest& request) {
  BatchPlan plan = plan_collection(request);
  const std::size_t in_collection = plan.models.size();
  plan.shard = request.shard;
  if (request.shard.count > 1) drop_other_shards(plan, request);
  read_unread(plan, [](const PlannedModel&) { return true; });
  plan.models_in_collection = request.shard.count > 1 ? in_collection : plan.models.size();
  return plan;
}

BatchPlan plan_collection(const PlanRequest& request) {
  BatchPlan plan;
  const auto base = request.base ? request.base : std::make_shared<const CompileOptions>();
  Profiles profiles(request);
  std::vector<std::string> others;
  for (const std::string& input : request.inputs)
    if (is_collection(input))
      add_collection(input, request, *base, profiles, plan);
    else
      others.push_back(input);
  for (const std::string& input : others)
    if (fs::is_directory(input)) plan.folders.push_back((fs::path(input) / "").string());
  const bool names_package =
      fs::path(request.output).extension() == ".texmesh" && !fs::is_directory(request.output);
  if (!plan.files.empty() && names_package)
    throw InputError(request.output, "", "a folder for the packages of a collection",
                     "the name of one package");
  if (!others.empty()) {
    std::vector<ModelPath> found = find_models(others, request.output, request.names, &plan.notes);
    plan.models.reserve(plan.models.size() + found.size());
    const bool alone = request.inputs.size() == 1 && names_package;
    for (ModelPath& m : found)
      plan.models.push_back(
          {std::move(m.input), std::move(m.output), alone, m.unread, profiles.of(base), nullptr});
  }
  refuse_shared_outputs(plan);
  plan.output_prefix = (fs::path(request.output) / "").string();
  plan.outputs = fs::absolute(request.output).lexically_normal().string();
  if (std::ranges::all_of(others, [](const std::string& input) { return fs::is_directory(input); }))
    plan.stale = stale_packages(plan);
  return plan;
}

std::string package_within(const BatchPlan& plan, const PlannedModel& m) {
  if (m.output.starts_with(plan.output_prefix)) return m.output.substr(plan.output_prefix.size());
  return fs::path(m.output).filename().string();
}

ShardSplit split_plan(const BatchPlan& plan, const PlanRequest& request, int shards) {
  ShardSplit split;
  std::vector<ModelCost> costs;
  split.packages.reserve(plan.models.size());  // the costs point into it
  for (const PlannedModel& m : plan.models) {
    split.packages.push_back(package_within(plan, m));
    costs.push_back({split.packages.back(), cost_us(m, split.packages.back(), request)});
  }
  split.collection = collection_digest(costs);
  split.shard_of = balance_shards(costs, shards);
  return split;
}

}  // namespace texmesh
