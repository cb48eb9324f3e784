#include "pipeline/batch/build_memo.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "pipeline/io/file_stamp.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

/// Segments that are read without being merged. A cluster of some hundred nodes leaves as many in one pass.
constexpr std::size_t kManySegments = 8;
/// What a killed run has left is merged when nobody can be writing it any more.
constexpr std::int64_t kAbandoned_ns = 86'400'000'000'000;

std::vector<std::string> segment_paths(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec)) {
    std::string path = it->path().string();
    if (path.ends_with(".seg") || path.ends_with(".open")) paths.push_back(std::move(path));
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace

BuildMemo::BuildMemo(const std::string& cache_folder, const std::string& outputs) {
  if (cache_folder.empty()) return;
  Key name("memo", 2);
  name.add("outputs", outputs);
  folder_ = cache_folder + "/memo/" + to_hex(name.digest()).substr(0, 32);
  writer_ = std::make_unique<MemoSegmentWriter>(folder_);
  constexpr int kAttempts = 5;  // somebody merges segments between our listing and our reading
  for (int i = 0; i < kAttempts && !read_all(); ++i) continue;
  keep_latest();
}

BuildMemo::~BuildMemo() {
  if (!writer_ || !wrote_) return;
  merge();
}

/// False when a segment that was listed is gone.
bool BuildMemo::read_all() {
  segments_.clear();
  places_.clear();
  bool all = true;
  for (const std::string& path : segment_paths(folder_)) {
    const auto number = static_cast<std::uint32_t>(segments_.size());
    auto segment = MemoSegment::read(path, [&](const MemoEntry& entry) {
      places_.push_back({entry, number});
    });
    if (segment)
      segments_.push_back(std::move(segment));
    else
      all = false;
  }
  return all;
}

void BuildMemo::keep_latest() {
  std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) {
    if (a.entry.name != b.entry.name) return a.entry.name < b.entry.name;
    if (a.entry.looked_at_ns != b.entry.looked_at_ns) return a.entry.looked_at_ns > b.entry.looked_at_ns;
    return std::pair(b.segment, b.entry.offset) < std::pair(a.segment, a.entry.offset);
  });
  const auto same = [](const Place& a, const Place& b) { return a.entry.name == b.entry.name; };
  places_.erase(std::unique(places_.begin(), places_.end(), same), places_.end());
}

bool BuildMemo::was_damaged() const {
  return std::any_of(segments_.begin(), segments_.end(), [](const auto& s) { return s->is_damaged(); });
}

const BuildMemo::Place* BuildMemo::place_of(const std::string& package) const {
  const MemoName name = memo_name(package);
  const auto at = std::lower_bound(places_.begin(), places_.end(), name,
                                   [](const Place& p, const MemoName& n) { return p.entry.name < n; });
  return at == places_.end() || at->entry.name != name ? nullptr : &*at;
}

bool BuildMemo::find(const std::string& package, MemoRecord& record) const {
  const Place* const place = place_of(package);
  if (!place) return false;
  auto found = segments_[place->segment]->record(place->entry);
  if (!found) return false;
  record = std::move(*found);
  return true;
}

StageKeys BuildMemo::keys(const std::string& package) const {
  const Place* const place = place_of(package);
  return place ? segments_[place->segment]->keys(place->entry) : StageKeys{};
}

void BuildMemo::set(const std::string& package, const MemoRecord& record) {
  if (!writer_) return;
  writer_->add(memo_name(package), record);
  wrote_ = true;
}

bool BuildMemo::save() { return !writer_ || writer_->flush(); }

/// Which segments become one: the small ones, while each is at most as large as those before it together, so
/// that a record is copied as often as the memo's size doubles. And what is damaged, or left by a killed run.
std::vector<std::uint32_t> BuildMemo::segments_to_merge() const {
  std::vector<std::uint32_t> finished, merged;
  for (std::uint32_t i = 0; i < segments_.size(); ++i) {
    const MemoSegment& s = *segments_[i];
    const bool abandoned = s.modified_ns() < wall_clock_ns() - kAbandoned_ns;
    if (s.is_damaged() || (!s.is_finished() && abandoned))
      merged.push_back(i);
    else if (s.is_finished())
      finished.push_back(i);
  }
  if (finished.size() < kManySegments) return merged;
  std::sort(finished.begin(), finished.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(segments_[a]->bytes(), a) < std::pair(segments_[b]->bytes(), b);
  });
  std::uint64_t before = 0;
  for (std::size_t i = 0; i < finished.size(); ++i) {
    if (i >= kManySegments / 2 && segments_[finished[i]]->bytes() > before) break;
    before += segments_[finished[i]]->bytes();
    merged.push_back(finished[i]);
  }
  return merged;
}

/// Two runs may merge the same segments at the same time: both then hold all their records. A reader that has
/// listed a segment before it was removed lists again.
void BuildMemo::merge() {
  const std::vector<std::uint32_t> chosen = segments_to_merge();
  const std::set<std::uint32_t> merged(chosen.begin(), chosen.end());
  for (const Place& place : places_) {
    if (!merged.contains(place.segment)) continue;
    // A later record may be in the new segment by now: the time tells which counts.
    auto record = segments_[place.segment]->record(place.entry);
    if (!record) continue;
    record->keys = segments_[place.segment]->keys(place.entry);
    writer_->add(place.entry.name, *record);
  }
  if (!writer_->finish()) return;
  for (const std::uint32_t i : merged) ::unlink(segments_[i]->path().c_str());
}

}  // namespace texmesh
