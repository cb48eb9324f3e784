#pragma once
#include <atomic>
#include <map>
#include <mutex>

#include "pipeline/graph/store.h"

namespace texmesh {

/// Keeps results in memory, as long as it lives: of graphs that share stages where there is no cache.
class MemoryStore : public Store {
 public:
  /// What comes from now on is forgotten, what is there stays.
  void close() { closed_ = true; }
  bool keeps_results() const override { return !closed_; }
  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override {
    const std::lock_guard lock(mutex_);
    const auto it = runs_.find(key);
    if (it == runs_.end()) return std::nullopt;
    return it->second;
  }
  SharedBytes load(const StoredBlob& blob) override {
    const std::lock_guard lock(mutex_);
    const auto it = blobs_.find(blob.digest);
    return it == blobs_.end() ? nullptr : it->second;
  }
  bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) override {
    if (closed_) return true;
    std::vector<StoredBlob> run;
    for (const auto& [name, bytes] : outputs) run.push_back({name, sha256(*bytes), bytes->size()});
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < run.size(); ++i) blobs_[run[i].digest] = outputs[i].second;
    runs_[key.digest()] = std::move(run);
    preimages_[key.digest()] = key.preimage();
    return true;
  }
  std::optional<std::string> preimage(const Sha256& key) override {
    const std::lock_guard lock(mutex_);
    const auto it = preimages_.find(key);
    if (it == preimages_.end()) return std::nullopt;
    return it->second;
  }
  void reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string&) override {
    const std::lock_guard lock(mutex_);
    if (const auto it = runs_.find(key); it != runs_.end() && it->second == found) runs_.erase(it);
  }
  std::optional<std::string> find_note(const Sha256& key) override {
    const std::lock_guard lock(mutex_);
    const auto it = notes_.find(key);
    if (it == notes_.end()) return std::nullopt;
    return it->second;
  }
  bool put_note(const Sha256& key, const std::string& text) override {
    const std::lock_guard lock(mutex_);
    notes_[key] = text;
    return true;
  }

 private:
  std::mutex mutex_;
  std::atomic<bool> closed_ = false;
  std::map<Sha256, std::vector<StoredBlob>> runs_;
  std::map<Sha256, SharedBytes> blobs_;
  std::map<Sha256, std::string> notes_, preimages_;
};

}  // namespace texmesh
