#include "pipeline/batch/fleet/model_list.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/obj/obj_material.h"
#include "pipeline/import/ply/ply_reader.h"
#include "pipeline/import/range/import_range.h"
#include "pipeline/import/text_scan.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kHeadBytes = 1 << 20, kMostJsonBytes = 256u << 20;

Bytes bytes_at(const std::string& path, std::uint64_t offset, std::size_t most) {
  std::ifstream in(path, std::ios::binary);
  in.seekg(0, std::ios::end);
  const auto end = in.tellg();
  if (!in || static_cast<std::uint64_t>(end) <= offset) return {};
  Bytes bytes(
      static_cast<std::size_t>(std::min<std::uint64_t>(most, static_cast<std::uint64_t>(end) - offset)));
  in.seekg(static_cast<std::streamoff>(offset));
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return bytes;
}

/// Which files there are; reads none of them.
class FilesThere : public Resolver {
 public:
  FilesThere(const std::string& folder, const std::vector<std::string>& links_within)
      : files_(folder, links_within) {}
  std::optional<Bytes> read(const std::string& uri, std::uint64_t) override {
    return files_.is_there(uri) ? std::optional<Bytes>(Bytes{}) : std::nullopt;
  }
  std::optional<Bytes> read_beside(const std::string& name, std::uint64_t max_bytes) override {
    return read(std::string(kTexturesBeside) + name, max_bytes);
  }
  std::vector<std::string> similar(const std::string& uri) override { return files_.similar(uri); }

 private:
  FileResolver files_;
};

class ListedFiles {
 public:
  ListedFiles(const std::string& model, const std::vector<std::string>& links_within)
      : model_(model), folder_(fs::path(model).parent_path()), files_(folder_.string(), links_within) {}

  std::vector<std::string> find() {
    const std::string ending = lower_ending(model_);
    if (ending == ".gltf") look_at_gltf(bytes_at(model_, 0, kMostJsonBytes));
    if (ending == ".glb") look_at_glb();
    if (ending == ".obj") look_at_obj();
    if (ending == ".ply") look_at_ply();
    if (ending == ".json") look_at_range_scan();
    return {found_.begin(), found_.end()};
  }

 private:
  /// The file's name beneath the model's folder, "" where there is none. Adds its other tiles, too.
  std::string add(const NameInModel& name) {
    constexpr std::uint16_t kEnd = kFirstTile + 10 * kTilesInARow;
    if (tile_mark(name.text) != TileMark::kNone)
      for (std::uint16_t tile = kFirstTile; tile < kEnd; ++tile)
        if (NameInModel of = name; (of.text = name_of_tile(name.text, tile)) != name.text) add(of);
    const NamedFile file = find_file(name, files_, kMostJsonBytes, notes_, "");
    if (!file.bytes) return "";
    found_.insert((folder_ / file.name).lexically_normal().string());
    return file.name;
  }

  void look_at_gltf(const Bytes& json) {
    const nlohmann::ordered_json document = parse_bounded_json(json, model_, 64);
    for (const char* list : {"buffers", "images"})
      for (const auto& item : document.value(list, nlohmann::ordered_json::array())) {
        const std::string uri = item.is_object() ? item.value("uri", "") : "";
        if (!uri.empty() && !is_data_uri(uri)) add({uri, "", true});
      }
  }

  void look_at_glb() {
    const Bytes head = bytes_at(model_, 0, 20);
    if (head.size() < 20) return;
    std::size_t length = 0;
    for (int i = 3; i >= 0; --i) length = length << 8 | head[static_cast<std::size_t>(12 + i)];
    Bytes json = bytes_at(model_, 20, std::min(length, kMostJsonBytes));
    while (!json.empty() && (json.back() == 0 || json.back() == ' ')) json.pop_back();
    look_at_gltf(json);
  }

  void look_at_obj() {
    const Bytes head = bytes_at(model_, 0, kHeadBytes);
    const SourceText text(text_of(head), model_, notes_);
    LineReader lines(text.text());
    for (std::string_view line; lines.next(line);) {
      if (!same_word(next_token(line), "mtllib") || add_library(std::string(line))) continue;
      for (const std::string& name : names_of_libraries(line)) add_library(name);
    }
  }

  bool add_library(const std::string& written) {
    const std::string name = add({written, "", false});
    if (name.empty()) return false;
    const MtlFile library = read_mtl(name, bytes_at((folder_ / name).string(), 0, kMostJsonBytes), notes_);
    for (const MtlMaterial& m : library.materials)
      for_each_map(m, [&](const std::string& file) { add({file, name, false}); });
    return true;
  }

  void look_at_ply() {
    for (const std::string& comment : read_ply_header(model_, bytes_at(model_, 0, kHeadBytes)).comments) {
      std::string_view rest = comment;
      if (same_word(next_token(rest), "TextureFile")) add({std::string(rest), "", false});
    }
  }

  void look_at_range_scan() {
    const Bytes bytes = bytes_at(model_, 0, kHeadBytes);
    const SourceText text(text_of(bytes), model_, notes_);
    const RangeScanDescription scan = read_range_scan_description(model_, text_bytes(text.text()));
    add({scan.grid, "", false});
    if (scan.texture) add({*scan.texture, "", false});
  }

  std::string model_;
  fs::path folder_;
  FilesThere files_;
  Notes notes_;  // of no interest here
  std::set<std::string> found_;
};

}  // namespace

std::vector<std::string> named_files(const std::string& model, const std::vector<std::string>& links_within) {
  try {
    return ListedFiles(model, links_within).find();
  } catch (const Error&) {
    return {};
  } catch (const nlohmann::json::exception&) {  // a list of another type
    return {};
  }
}

ModelList list_collection(const PlanRequest& request, int shards) {
  const BatchPlan plan = plan_collection(request);
  ModelList list;
  list.shards = shards;
  list.collections = plan.files;
  list.stale = plan.stale;
  const ShardSplit split = split_plan(plan, request, shards);
  list.collection = shards > 1 ? split.collection : "";
  for (std::size_t i = 0; i < plan.models.size(); ++i) {
    const PlannedModel& m = plan.models[i];
    if (m.unread && !holds_model(m.input)) continue;
    ListedModel listed{m.input,
                       m.output,
                       split.packages[i],
                       named_files(m.input, plan.folders),
                       bytes_of_file(m.input),
                       split.shard_of[i]};
    for (const std::string& file : listed.files) listed.bytes += bytes_of_file(file);
    list.models.push_back(std::move(listed));
  }
  return list;
}

std::string write_model_list(const ModelList& list) {
  return to_json_with_lines(list, "models", list.models);
}

DocumentSchema list_schema() {
  return document_schema(
      "list.v1", "texmesh list, version 1",
      "What `texmesh list --json` prints: the models of a collection with their packages and the files "
      "that they name.",
      schema_of<ModelList>());
}

}  // namespace texmesh
