#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "format/base/sha256.h"
#include "pipeline/graph/key.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// One output of a stage run in the store.
struct StoredBlob {
  std::string name;  // of the artefact, "import.mesh"
  Sha256 digest{};
  std::uint64_t bytes = 0;
  friend bool operator==(const StoredBlob&, const StoredBlob&) = default;
};
using SharedBytes = std::shared_ptr<const Bytes>;

/// Held while a key is computed, so that processes that share a store compute it once. Ends with the object,
/// and with the process however that ends.
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

/// Results of stage runs by key. A lookup never throws for what it finds: an absent, incomplete or damaged
/// entry is a miss. put() may fail quietly too (a full disk costs only the next build's time); it then
/// returns false. Safe from several threads.
class Store {
 public:
  virtual ~Store() = default;
  /// The blobs of a run, every one present and verified; nothing otherwise.
  virtual std::optional<std::vector<StoredBlob>> find(const Sha256& key) = 0;
  /// The bytes of a blob; null when it is gone or does not have this digest.
  virtual SharedBytes load(const StoredBlob& blob) = 0;
  virtual bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) = 0;
  /// The parts of a key that was put once (Key::preimage), whether its blobs are still there or not.
  virtual std::optional<std::string> preimage(const Sha256& key) = 0;
  /// What find() gave for the key is sound by its digests, but no result of this stage (`reason`): whoever
  /// wrote it was wrong. Such an entry is not given again.
  virtual void reject(const Sha256& /*key*/, const std::vector<StoredBlob>& /*found*/,
                      const std::string& /*reason*/) {}
  /// Small facts that are not results (which files an import asked for), by key; verified by their own
  /// digest. A later put_note replaces an earlier one.
  virtual std::optional<std::string> find_note(const Sha256& key) = 0;
  virtual bool put_note(const Sha256& key, const std::string& text) = 0;
  /// Waits until nobody else holds the key; null where there is nothing to share or locks do not work. Throws
  /// Cancelled. A thread that holds a claim must not wait for another one.
  virtual std::unique_ptr<Claim> claim(const Sha256&, const RunContext&) { return nullptr; }
  /// What has happened since the last call.
  virtual std::vector<StoreEvent> take_events() { return {}; }
};

/// Keeps nothing: --no-cache.
class NullStore : public Store {
 public:
  std::optional<std::vector<StoredBlob>> find(const Sha256&) override { return std::nullopt; }
  SharedBytes load(const StoredBlob&) override { return nullptr; }
  bool put(const Key&, const std::vector<std::pair<std::string, SharedBytes>>&) override { return true; }
  std::optional<std::string> preimage(const Sha256&) override { return std::nullopt; }
  std::optional<std::string> find_note(const Sha256&) override { return std::nullopt; }
  bool put_note(const Sha256&, const std::string&) override { return true; }
};

/// In memory, for tests.
class MemoryStore : public Store {
 public:
  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override;
  SharedBytes load(const StoredBlob& blob) override;
  bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) override;
  std::optional<std::string> preimage(const Sha256& key) override;
  void reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string& reason) override;
  std::optional<std::string> find_note(const Sha256& key) override;
  bool put_note(const Sha256& key, const std::string& text) override;

 private:
  std::mutex mutex_;
  std::map<Sha256, std::vector<StoredBlob>> runs_;
  std::map<Sha256, SharedBytes> blobs_;
  std::map<Sha256, std::string> notes_, preimages_;
};

}  // namespace texmesh
