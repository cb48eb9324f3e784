#include "pipeline/store.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "format/errors.h"
#include "pipeline/atomic_file.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

std::span<const std::uint8_t> as_bytes(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

std::optional<std::vector<std::uint8_t>> read_whole(const fs::path& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return std::nullopt;
  const auto size = in.tellg();
  if (size < 0) return std::nullopt;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(bytes.data()), size);
  if (!in) return std::nullopt;
  return bytes;
}

/// A record ends with the digest of everything before it, so that a cut or flipped record is noticed.
std::string seal(const std::string& body) { return body + "\n" + to_hex(sha256(as_bytes(body))) + "\n"; }
std::optional<std::string> unseal(const std::vector<std::uint8_t>& bytes) {
  if (bytes.size() < 66) return std::nullopt;
  const std::string text(bytes.begin(), bytes.end());
  const std::string body = text.substr(0, text.size() - 66);
  return seal(body) == text ? std::optional(body) : std::nullopt;
}

class DiskStore : public Store {
 public:
  explicit DiskStore(fs::path folder) : folder_(std::move(folder)) {
    std::error_code ec;
    for (const char* part : {"ac", "cas", "notes"}) {
      fs::create_directories(folder_ / part, ec);
      if (ec) throw InputError((folder_ / part).string(), "", "a cache folder", ec.message());
    }
  }

  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override {
    const fs::path path = place("ac", key);
    const auto bytes = read_whole(path);
    if (!bytes) return std::nullopt;
    auto blobs = parse_record(*bytes);
    if (!blobs) {
      quarantine(path);
      return std::nullopt;
    }
    for (const StoredBlob& b : *blobs)
      if (!load(b)) return std::nullopt;
    return blobs;
  }

  Bytes load(const StoredBlob& blob) override {
    const fs::path path = place("cas", blob.digest);
    auto bytes = read_whole(path);
    if (!bytes) return nullptr;
    if (bytes->size() != blob.bytes || sha256(*bytes) != blob.digest) {
      quarantine(path);
      return nullptr;
    }
    return std::make_shared<const std::vector<std::uint8_t>>(std::move(*bytes));
  }

  bool put(const Key& key, const std::vector<std::pair<std::string, Bytes>>& outputs) override {
    Json record{{"version", 1}, {"key", Json::parse(key.preimage())}, {"outputs", Json::array()}};
    for (const auto& [name, bytes] : outputs) {
      const Sha256 digest = sha256(*bytes);
      if (!publish(place("cas", digest), *bytes)) return false;
      record["outputs"].push_back({{"name", name}, {"sha256", to_hex(digest)}, {"bytes", bytes->size()}});
    }
    return publish(place("ac", key.digest()), as_bytes(seal(record.dump(1))));
  }

  std::optional<std::string> find_note(const Sha256& key) override {
    const auto bytes = read_whole(place("notes", key));
    return bytes ? unseal(*bytes) : std::nullopt;
  }
  bool put_note(const Sha256& key, const std::string& text) override {
    return publish(place("notes", key), as_bytes(seal(text)));
  }

 private:
  fs::path place(const char* kind, const Sha256& digest) const {
    const std::string hex = to_hex(digest);
    return folder_ / kind / hex.substr(0, 2) / hex;
  }

  static std::optional<std::vector<StoredBlob>> parse_record(const std::vector<std::uint8_t>& bytes) {
    const auto body = unseal(bytes);
    if (!body) return std::nullopt;
    const Json j = Json::parse(*body, nullptr, false);
    if (!j.is_object() || j.value("version", 0) != 1) return std::nullopt;
    std::vector<StoredBlob> blobs;
    for (const Json& o : j["outputs"]) {
      StoredBlob b;
      b.name = o.value("name", "");
      b.bytes = o.value("bytes", std::uint64_t{0});
      if (!from_hex(o.value("sha256", ""), b.digest)) return std::nullopt;
      blobs.push_back(b);
    }
    return blobs;
  }

  static bool publish(const fs::path& path, std::span<const std::uint8_t> bytes) {
    try {
      std::error_code ec;
      if (file_holds(path.string(), bytes)) return true;
      fs::create_directories(path.parent_path(), ec);
      write_file_atomically(path.string(), bytes);
      return true;
    } catch (const InputError&) {
      return false;
    }
  }

  void quarantine(const fs::path& path) const {
    std::error_code ec;
    fs::create_directories(folder_ / "quarantine", ec);
    fs::rename(path, folder_ / "quarantine" / path.filename(), ec);
  }

  fs::path folder_;
};

}  // namespace

std::optional<std::vector<StoredBlob>> MemoryStore::find(const Sha256& key) {
  const std::lock_guard lock(mutex_);
  const auto it = runs_.find(key);
  if (it == runs_.end()) return std::nullopt;
  return it->second;
}
Bytes MemoryStore::load(const StoredBlob& blob) {
  const std::lock_guard lock(mutex_);
  const auto it = blobs_.find(blob.digest);
  return it == blobs_.end() ? nullptr : it->second;
}
bool MemoryStore::put(const Key& key, const std::vector<std::pair<std::string, Bytes>>& outputs) {
  std::vector<StoredBlob> run;
  for (const auto& [name, bytes] : outputs) run.push_back({name, sha256(*bytes), bytes->size()});
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < run.size(); ++i) blobs_[run[i].digest] = outputs[i].second;
  runs_[key.digest()] = std::move(run);
  return true;
}
std::optional<std::string> MemoryStore::find_note(const Sha256& key) {
  const std::lock_guard lock(mutex_);
  const auto it = notes_.find(key);
  if (it == notes_.end()) return std::nullopt;
  return it->second;
}
bool MemoryStore::put_note(const Sha256& key, const std::string& text) {
  const std::lock_guard lock(mutex_);
  notes_[key] = text;
  return true;
}

std::unique_ptr<Store> open_disk_store(const std::string& folder) {
  return std::make_unique<DiskStore>(folder);
}

std::string default_cache_folder(const std::string& flag) {
  if (!flag.empty()) return flag;
  auto variable = [](const char* name) {
    const char* v = std::getenv(name);
    return std::string(v ? v : "");
  };
  if (const std::string v = variable("TEXMESH_CACHE"); !v.empty()) return v;
  if (const std::string v = variable("XDG_CACHE_HOME"); !v.empty() && v.front() == '/') return v + "/texmesh";
  if (const std::string v = variable("HOME"); !v.empty()) return v + "/.cache/texmesh";
  return "";
}

}  // namespace texmesh
