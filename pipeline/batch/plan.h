#pragma once
#include <functional>
#include <map>
#include <memory>

#include "format/base/note.h"
#include "pipeline/batch/fleet/shard.h"

namespace texmesh {

/// What a model counts when shards are balanced.
struct ModelCost {
  std::string_view name;  // its package, relative to the output folder: no two are equal
  std::uint64_t cost_us = 0;
};

/// The shard of every model: the costliest first, each to the shard with the least cost so far. So no shard
/// costs more than the mean and one model. The result depends on names and costs alone, not on the models'
/// order: tasks that see the same files agree without a word to each other.
std::vector<int> balance_shards(const std::vector<ModelCost>& models, int shards);

/// Hexadecimal SHA-256 over names and costs in the order of the names. Tasks with equal digests have split
/// the same collection the same way.
std::string collection_digest(const std::vector<ModelCost>& models);

/// 0 where it is not there.
std::uint64_t bytes_of_file(const std::string& path);
/// What a model takes that was never compiled, by the bytes of its file: measured on the sample scans,
/// rounded up.
double guessed_seconds(std::uint64_t model_bytes);

struct CompileOptions;

/// What packages of folders are called that no collection names: bust.texmesh or bust.glb.texmesh of
/// bust.glb.
enum class PackageNames : std::uint8_t { kStem, kFull };
template <>
struct EnumNames<PackageNames> {
  static constexpr std::array<std::string_view, 2> names{"stem", "full"};
};

/// A model to compile and where its package goes.
struct ModelPath {
  std::string input, output;
  bool unread = false;  // a .json or .zip of a folder: a model only where holds_model() says so
};

/// The models that `inputs` name: files as they are; of a folder every .glb .gltf .obj .ply .stl .zip and
/// .json beneath it, sorted by path. One input file with an `output` that ends in .texmesh gives that
/// package; otherwise `output` is a folder, and a model's package stands in it under the same relative path
/// with the ending .texmesh: in the place of the model's own, or with `names` kFull behind it
/// (a.glb.texmesh). So no other model changes a package's name. What a .json holds does not count: a shard of
/// a run opens its own ones only. `notes` get a word of scans in formats that are not read. InputError for
/// what is not there.
std::vector<ModelPath> find_models(const std::vector<std::string>& inputs, const std::string& output,
                                   PackageNames names = PackageNames::kStem, Notes* notes = nullptr);

/// The files beneath a folder that find_models finds there: paths relative to it, sorted. InputError when the
/// folder is not there or holds no model, Error when this user may not list it.
std::vector<std::string> list_models(const std::string& folder, Notes* notes = nullptr);

/// By its name: only what it holds tells whether it is a model.
bool is_told_by_content(const std::string& path);

/// A JSON file that says within its first bytes that it is a range scan (others are collections), or a ZIP
/// archive that names a model, or cannot be listed.
bool holds_model(const std::string& path);

/// One model of a collection.
struct CollectionModel {
  std::string input;   // path; relative ones are relative to the collection's folder
  std::string output;  // path beneath the output folder, ends with ".texmesh"
  // Defaults, then the collection's options, then those of the patterns that match, in their order, then the
  // model's own. What `about` says of each of them goes the same way, field by field, into package.meta.
  // Models with equal options share them.
  std::shared_ptr<const CompileOptions> options;
  bool unread = false;  // a folder's .json, as in ModelPath; its output may be another's
};

/// Finds the models of a folder that a collection names, as list_models(): paths relative to the folder,
/// sorted. The reader itself looks at no folder.
using FolderLister = std::function<std::vector<std::string>(const std::string& folder)>;

/// The text of annotations.json that a file of notes gives; its name is as the collection has it. Without a
/// reader models have none.
using NotesReader = std::function<std::string(const std::string& name)>;

/// Reads a collection (schemas/collection.v1.schema.json): models, folders of models, and their options.
/// Strict: unknown fields, wrong types, options out of range, outputs that leave the output folder and
/// outputs named twice throw InputError{file_name, JSON pointer, ...}. `base` holds the options that the
/// collection starts from (a profile). A model that is listed and found in a folder, too, is compiled
/// once, as listed. Patterns are matched against the input as the collection writes it; `*` and `?` match
/// "/" as well; `notes` get a word of those that match no model.
std::vector<CollectionModel> read_collection(const std::string& json, const std::string& file_name,
                                             const CompileOptions& base, const FolderLister& list_folder = {},
                                             PackageNames names = PackageNames::kStem,
                                             const NotesReader& read_notes = {}, Notes* notes = nullptr);

/// One model of a run.
struct PlannedModel {
  std::string input, output;                   // paths as this process can open them
  bool alone = false;                          // the one model of a package that the command line names
  bool unread = false;                         // as in ModelPath
  std::shared_ptr<const std::string> profile;  // JSON of every option; models with equal options share it
  std::shared_ptr<const std::string> meets =
      nullptr;  // of an unread file: the model whose package it would share
  /// As messages and reports call it.
  std::string_view name() const { return std::string_view(input).substr(alone ? input.rfind('/') + 1 : 0); }
};

struct PlanRequest {
  std::vector<std::string> inputs;                   // models, folders, collections
  std::string output;                                // package or folder
  std::shared_ptr<const CompileOptions> base;        // of the profile, not resolved; null = defaults
  std::function<void(CompileOptions&)> apply_flags;  // the command line's options, which win over everything
  PackageNames names = PackageNames::kStem;
  Shard shard;                            // this run's part
  std::map<std::string, double> costs_s;  // by package within the output folder: what models took before
};

struct BatchPlan {
  std::vector<PlannedModel> models;
  std::vector<std::string> files;  // collections, and notes they name: a make-style rule depends on them
  Notes notes;                     // of what is left out of these notes, and files that are no models
  std::vector<std::string>
      folders;          // that the command line or a collection stands for, with a slash at the end
  std::string outputs;  // absolute path of the output folder, or of the package where there can be one only
  std::string output_prefix;  // what the models' outputs begin with: the output folder and a slash
  /// Packages in the output folder that no model of the folders and collections makes: paths within it,
  /// sorted. Empty where a single file is named: then its siblings are no business of the run's.
  std::vector<std::string> stale;
  Shard shard;
  std::size_t models_in_collection = 0;  // of all shards: their unread ones count
  std::string collection;                // collection_digest() where there are several shards, else ""
};

/// Finds the models and their options. Several shards are balanced by `costs_s`, and by the sizes of the
/// models' files where a model is not among them: runs that see the same files and costs split the models
/// alike, and open only their own. InputError for what makes no sense, before anything is compiled; so for
/// two models of one package, and of packages whose names differ only in case or composition (name_key()).
BatchPlan plan_batch(const PlanRequest& request);

/// The same before it is split on shards: what names alone tell, unread files with it.
BatchPlan plan_collection(const PlanRequest& request);

/// The path of a model's package within the output folder; its name where the run makes one package only.
std::string package_within(const BatchPlan& plan, const PlannedModel& model);

/// How the models of a plan_collection() fall on shards.
struct ShardSplit {
  std::vector<std::string> packages;  // of each model: its package's path within the output folder
  std::vector<int> shard_of;
  std::string collection;  // collection_digest()
};
ShardSplit split_plan(const BatchPlan& plan, const PlanRequest& request, int shards);

}  // namespace texmesh
