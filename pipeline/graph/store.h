#pragma once
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "format/base/bytes.h"
#include "format/base/sha256.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// Raise when the way keys are made changes.
inline constexpr int kKeySchema = 1;

/// Everything that a stage run depends on, as labelled parts. The key's digest is the SHA-256 over the
/// length-prefixed labels and values in order. The parts are kept beside each cache entry, so that a miss can
/// be explained.
class Key {
 public:
  Key(std::string_view stage, int stage_version);
  Key& add(std::string label, std::string value);
  /// An input artefact: role, digest and size. Downstream keys hold *output* digests, so an equal result
  /// stops the wave.
  Key& add_input(std::string_view role, const Sha256& digest, std::uint64_t bytes);
  Sha256 digest() const;
  const std::vector<std::pair<std::string, std::string>>& parts() const { return parts_; }
  /// The parts behind those that the constructor made (schema, stage, version).
  std::vector<std::pair<std::string, std::string>> added_parts() const;
  /// The parts as a JSON object of strings.
  std::string preimage() const;

 private:
  Key() = default;
  friend std::optional<Key> key_from_json(const nlohmann::ordered_json& json);
  std::vector<std::pair<std::string, std::string>> parts_;
};

/// A key from its preimage, with the same parts in the same order; nothing when it is no preimage.
std::optional<Key> key_from_preimage(const std::string& preimage);
std::optional<Key> key_from_json(const nlohmann::ordered_json& json);

/// The keys that the stages of one model had, by stage name.
using StageKeys = std::map<std::string, Sha256>;

/// The digest of a key that has these parts.
Sha256 digest_of_parts(const std::vector<std::pair<std::string, std::string>>& parts);

/// One output of a stage run in the store.
struct StoredBlob {
  std::string name;  // of the artefact, "import.mesh"
  Sha256 digest{};
  std::uint64_t bytes = 0;
  friend bool operator==(const StoredBlob&, const StoredBlob&) = default;
  static void fields(auto& s, auto&& v) {
    v("name", s.name, "");
    v("sha256", s.digest, "");
    v("bytes", s.bytes, "");
  }
};
using SharedBytes = std::shared_ptr<const Bytes>;

/// Held while a key's results are computed, so that processes that share a store compute the results once. A
/// claim ends with the object, and with the process however the process ends.
class Claim {
 public:
  virtual ~Claim() = default;
};

/// Something about the store that a person should know; never a reason to fail.
struct StoreEvent {
  std::string code;  // "cache-entry-damaged", "cache-layer-unreachable", "cache-not-written"
  std::string text;
  int layer = -1;  // "cache-layer-unreachable": its number
};

/// Results of stage runs by key. A lookup never throws: an absent, incomplete or damaged entry is a miss.
/// put() does not throw either; it returns false when it fails, which costs only the next build's time. Safe
/// from several threads.
class Store {
 public:
  virtual ~Store() = default;
  /// The blobs of a run, every one present and verified; nothing otherwise.
  virtual std::optional<std::vector<StoredBlob>> find(const Sha256& key) = 0;
  /// The bytes of a blob; null when it is gone or does not have this digest.
  virtual SharedBytes load(const StoredBlob& blob) = 0;
  virtual bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) = 0;
  /// False where put() forgets what it is given: its results need not be in memory together.
  virtual bool keeps_results() const { return true; }
  /// The parts of a key that was put once (Key::preimage), whether its blobs are still there or not.
  virtual std::optional<std::string> preimage(const Sha256& key) = 0;
  /// The blobs that find() gave for the key have their digests but are no results of the stage (`reason`).
  /// The store does not give the entry again.
  virtual void reject(const Sha256& /*key*/, const std::vector<StoredBlob>& /*found*/,
                      const std::string& /*reason*/) {}
  /// Small facts that are not results (which files an import asked for), by key; verified by their own
  /// digest. A later put_note replaces an earlier one.
  virtual std::optional<std::string> find_note(const Sha256& key) = 0;
  virtual bool put_note(const Sha256& key, const std::string& text) = 0;
  /// Waits until nobody else holds the key; null where nobody shares the store or locks do not work. Throws
  /// Cancelled. A thread that holds a claim must not ask for another claim.
  virtual std::unique_ptr<Claim> claim(const Sha256&, const RunContext&) { return nullptr; }
  /// The events since the last call.
  virtual std::vector<StoreEvent> take_events() { return {}; }
};

/// Keeps nothing: --no-cache.
class NullStore : public Store {
 public:
  std::optional<std::vector<StoredBlob>> find(const Sha256&) override { return std::nullopt; }
  SharedBytes load(const StoredBlob&) override { return nullptr; }
  bool put(const Key&, const std::vector<std::pair<std::string, SharedBytes>>&) override { return true; }
  bool keeps_results() const override { return false; }
  std::optional<std::string> preimage(const Sha256&) override { return std::nullopt; }
  std::optional<std::string> find_note(const Sha256&) override { return std::nullopt; }
  bool put_note(const Sha256&, const std::string&) override { return true; }
};

}  // namespace texmesh
