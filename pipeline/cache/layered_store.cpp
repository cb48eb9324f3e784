// A store with layers behind it: shared folders and servers that hold what other machines computed.
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>

#include "format/base/text_bytes.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/cache/cache_layer.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMaxEntryBytes = 1 << 22, kMaxBlobBytes = 1ull << 34;

class FolderLayer : public CacheLayer {
 public:
  explicit FolderLayer(std::string folder) : folder_(std::move(folder)) {}
  std::string name() const override { return folder_; }
  std::optional<Bytes> get(const char* kind, const Sha256& digest, std::uint64_t max_bytes) override {
    if (!std::filesystem::is_directory(folder_)) throw LayerError("no such folder");
    return read_whole(folder_ + "/" + object_path(kind, digest), max_bytes);
  }
  void put(const char*, const Sha256&, ByteSpan) override {}

 private:
  std::string folder_;
};

class LayeredStore : public Store {
 public:
  LayeredStore(std::unique_ptr<Store> local, std::vector<std::unique_ptr<CacheLayer>> layers, LayerUse use,
               const LayerClock& clock)
      : local_(std::move(local)), use_(use) {
    for (auto& l : layers)
      layers_.push_back(
          {std::move(l), LayerRest(clock), LayerRest(clock), static_cast<int>(layers_.size()), {}});
  }

  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override {
    if (auto found = local_->find(key)) return found;
    if (is_rejected(key)) return std::nullopt;
    for (Layer& layer : layers_)
      if (auto brought = bring(layer, key)) {
        if (use_ == LayerUse::kLook) return brought;
        if (auto found = local_->find(key)) return found;
      }
    return std::nullopt;
  }

  SharedBytes load(const StoredBlob& blob) override {
    if (SharedBytes bytes = local_->load(blob)) return bytes;
    for (Layer& layer : layers_)
      if (auto bytes = get(layer, "cas", blob.digest, blob.bytes)) {
        if (is(blob, *bytes)) return std::make_shared<const Bytes>(std::move(*bytes));
        remember_damage(layer, blob.digest);
      }
    return nullptr;
  }

  bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) override {
    const bool kept = local_->put(key, outputs);
    if (use_ != LayerUse::kUpload) return kept;
    CacheEntry entry{key.preimage(), {}};
    for (const auto& [name, bytes] : outputs) entry.outputs.push_back({name, sha256(*bytes), bytes->size()});
    const std::string text = write_entry(entry);
    for (Layer& layer : layers_)
      give(layer, [&] {  // blobs first: an entry must never name what is not there
        for (std::size_t i = 0; i < outputs.size(); ++i) {
          const Sha256& digest = entry.outputs[i].digest;
          if (was_damaged(layer, digest) || !layer.layer->has("cas", digest, outputs[i].second->size()))
            layer.layer->put("cas", digest, *outputs[i].second);
        }
        layer.layer->put("ac", key.digest(), text_bytes(text));
      });
    return kept;
  }

  std::optional<std::string> preimage(const Sha256& key) override { return local_->preimage(key); }

  /// No layer is asked for this key again: the one that gave it would give the same.
  void reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string& reason) override {
    {
      const std::lock_guard lock(mutex_);
      rejected_.insert(key);
    }
    local_->reject(key, found, reason);
  }

  std::optional<std::string> find_note(const Sha256& key) override {
    if (auto note = local_->find_note(key)) return note;
    for (Layer& layer : layers_)
      if (const auto bytes = get(layer, "notes", key, kMaxEntryBytes))
        if (auto text = unseal(*bytes)) {
          local_->put_note(key, *text);
          return text;
        }
    return std::nullopt;
  }

  bool put_note(const Sha256& key, const std::string& text) override {
    const bool kept = local_->put_note(key, text);
    if (use_ == LayerUse::kUpload) {
      const std::string sealed = seal(text);
      for (Layer& layer : layers_) give(layer, [&] { layer.layer->put("notes", key, text_bytes(sealed)); });
    }
    return kept;
  }

  std::unique_ptr<Claim> claim(const Sha256& key, const RunContext& context) override {
    return local_->claim(key, context);
  }

  std::vector<StoreEvent> take_events() override {
    auto events = local_->take_events();
    const std::lock_guard lock(mutex_);
    events.insert(events.end(), events_.begin(), events_.end());
    events_.clear();
    return events;
  }

 private:
  struct Layer {
    std::unique_ptr<CacheLayer> layer;  // null: does not work
    LayerRest asking, giving;           // after a failure; after a refusal
    int number = 0;
    std::set<Sha256> damaged;  // blobs that it has, but not with their digests
  };

  bool is_rejected(const Sha256& key) {
    const std::lock_guard lock(mutex_);
    return rejected_.contains(key);
  }

  static bool is(const StoredBlob& blob, const Bytes& bytes) {
    return bytes.size() == blob.bytes && sha256(bytes) == blob.digest;
  }

  void remember_damage(Layer& layer, const Sha256& digest) {
    const std::lock_guard lock(mutex_);
    layer.damaged.insert(digest);
  }
  bool was_damaged(const Layer& layer, const Sha256& digest) {
    const std::lock_guard lock(mutex_);
    return layer.damaged.contains(digest);
  }

  /// Puts something into a layer that may refuse it.
  template <class F>
  void give(Layer& layer, F&& f) {
    {
      const std::lock_guard lock(mutex_);
      if (layer.giving.holds()) return;
    }
    guarded(layer, [&] {
      try {
        f();
      } catch (const LayerRefusal& e) {
        const std::lock_guard lock(mutex_);
        if (!layer.giving.holds())
          events_.push_back({"cache-not-written", layer.layer->name() + " takes no results: " + e.what() +
                                                      "; it is read all the same"});
        layer.giving.begin();
      }
    });
  }

  template <class F>
  void guarded(Layer& layer, F&& f) {
    {
      const std::lock_guard lock(mutex_);
      if (!layer.layer || layer.asking.holds()) return;
    }
    try {
      f();
    } catch (const LayerError& e) {
      const std::lock_guard lock(mutex_);
      if (!layer.asking.holds())
        events_.push_back(
            {"cache-layer-unreachable", layer.layer->name() + " is left out: " + e.what(), layer.number});
      layer.asking.begin();
    }
  }

  std::optional<Bytes> get(Layer& layer, const char* kind, const Sha256& digest, std::uint64_t max_bytes) {
    std::optional<Bytes> bytes;
    guarded(layer, [&] { bytes = layer.layer->get(kind, digest, max_bytes); });
    return bytes;
  }

  std::nullopt_t report_damaged(const Layer& layer, const std::string& what) {
    const std::lock_guard lock(mutex_);
    events_.push_back({"cache-entry-damaged", what + " from " + layer.layer->name() + "; not used"});
    return std::nullopt;
  }

  /// Copies a run of a stage from a layer into the local store (unless that is only looked at), if all of it
  /// is there and sound.
  std::optional<std::vector<StoredBlob>> bring(Layer& layer, const Sha256& key) {
    const auto bytes = get(layer, "ac", key, kMaxEntryBytes);
    if (!bytes) return std::nullopt;
    const auto entry = read_entry(*bytes, key);
    if (!entry) return report_damaged(layer, "what is no entry of its key");
    std::vector<std::pair<std::string, SharedBytes>> outputs;
    for (const StoredBlob& blob : entry->outputs) {
      if (blob.bytes > kMaxBlobBytes) return std::nullopt;
      auto blob_bytes = get(layer, "cas", blob.digest, blob.bytes);
      if (!blob_bytes) return std::nullopt;
      if (!is(blob, *blob_bytes)) {
        remember_damage(layer, blob.digest);
        return report_damaged(layer, "the result " + blob.name + ", which does not have its digest,");
      }
      outputs.emplace_back(blob.name, std::make_shared<const Bytes>(std::move(*blob_bytes)));
    }
    if (use_ == LayerUse::kLook) return entry->outputs;
    const auto original = key_from_preimage(entry->preimage);
    if (!original || !local_->put(*original, outputs)) return std::nullopt;
    return entry->outputs;
  }

  std::unique_ptr<Store> local_;
  std::vector<Layer> layers_;
  LayerUse use_;
  std::mutex mutex_;
  std::set<Sha256> rejected_;
  std::vector<StoreEvent> events_;
};

}  // namespace

std::unique_ptr<CacheLayer> open_layer(const std::string& place, const LayerPatience& patience) {
  if (place.find("://") != std::string::npos) return open_http_layer(place, patience);
  return std::make_unique<FolderLayer>(place);
}

std::unique_ptr<Store> layered_store(std::unique_ptr<Store> local,
                                     std::vector<std::unique_ptr<CacheLayer>> layers, LayerUse use,
                                     const LayerClock& clock) {
  return std::make_unique<LayeredStore>(std::move(local), std::move(layers), use, clock);
}

void check_layer(const std::string& place) {
  if (place.find("://") != std::string::npos && !place.starts_with("http://") &&
      !place.starts_with("https://"))
    throw InputError("cache layer", "", "a folder, or a URL that begins with http:// or https://",
                     place.substr(0, place.find("://") + 3) + "...");
}

LayerPatience patience_within(double limit_s) {
  LayerPatience patience;
  if (limit_s <= 0) return patience;
  patience.all_transfers_s = std::min(patience.all_transfers_s, limit_s / 4);
  patience.answer_s = std::min(patience.answer_s, patience.all_transfers_s);
  return patience;
}

std::vector<std::string> layers_from_environment() {
  const char* text = std::getenv("TEXMESH_CACHE_LAYERS");
  std::istringstream in(text ? text : "");
  std::vector<std::string> places;
  for (std::string place; in >> place;) places.push_back(place);
  return places;
}

}  // namespace texmesh
