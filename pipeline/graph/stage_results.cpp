#include "pipeline/graph/stage_results.h"

#include "format/base/archive.h"
#include "format/base/errors.h"

namespace texmesh {

std::optional<FoundResults> find_results(Store& store, const Stage& stage, const Sha256& key) {
  auto blobs = store.find(key);
  if (!blobs) return std::nullopt;
  if (blobs->size() != stage.outputs.size() + 1) {
    store.reject(key, *blobs, std::to_string(blobs->size()) + " results");
    return std::nullopt;
  }
  const SharedBytes bytes = store.load(blobs->back());
  if (!bytes) return std::nullopt;
  FoundResults found;
  try {
    found.notes = decode_artefact<Notes>(*bytes, stage.name + ".notes");
  } catch (const Error& e) {
    store.reject(key, *blobs, e.what());
    return std::nullopt;
  }
  found.blobs = std::move(*blobs);
  return found;
}

std::optional<std::vector<StoredBlob>> look_for_results(Store& store, const Stage& stage, const Sha256& key) {
  auto blobs = store.find(key);
  if (!blobs || blobs->size() != stage.outputs.size() + 1) return std::nullopt;
  return blobs;
}

LoadedResult load_result(Store& store, const Stage& stage, std::size_t output, const Sha256& key,
                         const std::vector<StoredBlob>& blobs) {
  const SharedBytes bytes = store.load(blobs.at(output));
  if (!bytes) return {};
  try {
    return {stage.outputs[output].decode(*bytes), false};
  } catch (const Error& e) {
    store.reject(key, blobs, e.what());
    return {nullptr, true};
  }
}

std::vector<StoredBlob> put_results(Store& store, const Stage& stage, const Key& key,
                                    const StageResult& result) {
  std::vector<std::pair<std::string, SharedBytes>> encoded;
  std::vector<StoredBlob> blobs;
  const std::string notes = stage.name + ".notes";
  if (!store.keeps_results()) {
    const auto add = [&](const std::string& name, const ArtefactDigest& d) {
      blobs.push_back({name, d.digest, d.bytes});
    };
    for (std::size_t k = 0; k < stage.outputs.size(); ++k)
      add(stage.outputs[k].name, stage.outputs[k].digest(result.objects[k].get()));
    add(notes, digest_artefact(result.notes));
    return blobs;
  }
  const auto add = [&](const std::string& name, Bytes bytes) {
    blobs.push_back({name, sha256(bytes), bytes.size()});
    encoded.emplace_back(name, std::make_shared<const Bytes>(std::move(bytes)));
  };
  for (std::size_t k = 0; k < stage.outputs.size(); ++k)
    add(stage.outputs[k].name, stage.outputs[k].encode(result.objects[k].get()));
  add(notes, encode_artefact(result.notes));
  store.put(key, encoded);
  return blobs;
}

}  // namespace texmesh
