#include "pipeline/graph/store.h"

namespace texmesh {

std::optional<std::vector<StoredBlob>> MemoryStore::find(const Sha256& key) {
  const std::lock_guard lock(mutex_);
  const auto it = runs_.find(key);
  if (it == runs_.end()) return std::nullopt;
  return it->second;
}
SharedBytes MemoryStore::load(const StoredBlob& blob) {
  const std::lock_guard lock(mutex_);
  const auto it = blobs_.find(blob.digest);
  return it == blobs_.end() ? nullptr : it->second;
}
bool MemoryStore::put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) {
  std::vector<StoredBlob> run;
  for (const auto& [name, bytes] : outputs) run.push_back({name, sha256(*bytes), bytes->size()});
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < run.size(); ++i) blobs_[run[i].digest] = outputs[i].second;
  runs_[key.digest()] = std::move(run);
  preimages_[key.digest()] = key.preimage();
  return true;
}
std::optional<std::string> MemoryStore::preimage(const Sha256& key) {
  const std::lock_guard lock(mutex_);
  const auto it = preimages_.find(key);
  if (it == preimages_.end()) return std::nullopt;
  return it->second;
}
void MemoryStore::reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string&) {
  const std::lock_guard lock(mutex_);
  if (const auto it = runs_.find(key); it != runs_.end() && it->second == found) runs_.erase(it);
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

}  // namespace texmesh
