#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "format/sha256.h"
#include "pipeline/key.h"

namespace texmesh {

/// One output of a stage run in the store.
struct StoredBlob {
  std::string name;  // of the artefact, "import.mesh"
  Sha256 digest{};
  std::uint64_t bytes = 0;
};
using Bytes = std::shared_ptr<const std::vector<std::uint8_t>>;

/// Results of stage runs by key. A lookup never throws for what it finds: an absent, incomplete or damaged
/// entry is a miss. put() may fail quietly too (a full disk costs only the next build's time); it then
/// returns false.
class Store {
 public:
  virtual ~Store() = default;
  /// The blobs of a run, every one present and verified; nothing otherwise.
  virtual std::optional<std::vector<StoredBlob>> find(const Sha256& key) = 0;
  /// The bytes of a blob; null when it is gone or does not have this digest.
  virtual Bytes load(const StoredBlob& blob) = 0;
  virtual bool put(const Key& key, const std::vector<std::pair<std::string, Bytes>>& outputs) = 0;
  /// Small facts that are not results (which files an import asked for), by key; unverified beyond their own
  /// digest.
  virtual std::optional<std::string> find_note(const Sha256& key) = 0;
  virtual bool put_note(const Sha256& key, const std::string& text) = 0;
};

/// Keeps nothing: --no-cache.
class NullStore : public Store {
 public:
  std::optional<std::vector<StoredBlob>> find(const Sha256&) override { return std::nullopt; }
  Bytes load(const StoredBlob&) override { return nullptr; }
  bool put(const Key&, const std::vector<std::pair<std::string, Bytes>>&) override { return true; }
  std::optional<std::string> find_note(const Sha256&) override { return std::nullopt; }
  bool put_note(const Sha256&, const std::string&) override { return true; }
};

/// In memory, for tests.
class MemoryStore : public Store {
 public:
  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override;
  Bytes load(const StoredBlob& blob) override;
  bool put(const Key& key, const std::vector<std::pair<std::string, Bytes>>& outputs) override;
  std::optional<std::string> find_note(const Sha256& key) override;
  bool put_note(const Sha256& key, const std::string& text) override;

 private:
  std::mutex mutex_;
  std::map<Sha256, std::vector<StoredBlob>> runs_;
  std::map<Sha256, Bytes> blobs_;
  std::map<Sha256, std::string> notes_;
};

/// On disk: `ac/<k[0:2]>/<key>` (a JSON record: the key's parts, the outputs, and its own digest) and
/// `cas/<d[0:2]>/<digest>` (the bytes). Published by temporary file, fdatasync, rename and folder fsync,
/// blobs first; verified on every hit; damaged entries are moved to `quarantine/`. Safe between processes
/// without locks: two that compute the same key write the same bytes.
std::unique_ptr<Store> open_disk_store(const std::string& folder);  // InputError when it cannot be made

/// --cache, else TEXMESH_CACHE, else $XDG_CACHE_HOME/texmesh, else ~/.cache/texmesh; "" when none of them is
/// there.
std::string default_cache_folder(const std::string& flag);

}  // namespace texmesh
