// What earlier runs have found out, and which models need not run by it.
#include "pipeline/batch/build_memo.h"

#include <filesystem>
#include <set>

#include "pipeline/io/program.h"

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

/// The memory of a model that was never compiled: measured on the sample scans, rounded up.
constexpr std::uint64_t kBaseMemory_bytes = 300'000'000, kMemoryPerByte = 10;

/// Failures that only another machine or another moment explains are not remembered.
bool is_lasting(const WorkerReport& r) {
  return r.result == ModelResult::kFailed &&
         (r.more->error.kind == "input" || r.more->error.kind == "format" || r.more->error.kind == "stage");
}

}  // namespace

BuildMemo::BuildMemo(const std::string& cache_folder, const std::string& outputs) {
  if (cache_folder.empty()) return;
  Key name("memo", 4);
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

bool BuildMemo::find(const std::string& package, PackageMemo& memo) const {
  const Place* const place = place_of(package);
  if (!place) return false;
  auto found = segments_[place->segment]->memo(place->entry);
  if (!found) return false;
  memo = std::move(*found);
  return true;
}

StageKeys BuildMemo::keys(const std::string& package) const {
  const Place* const place = place_of(package);
  return place ? segments_[place->segment]->keys(place->entry) : StageKeys{};
}

void BuildMemo::set(const std::string& package, const PackageMemo& memo) {
  if (!writer_) return;
  writer_->add(memo_name(package), memo);
  wrote_ = true;
}

bool BuildMemo::save() { return !writer_ || writer_->flush(); }

/// Which segments become one: the small ones, while each is at most as large as those before it together, so
/// that a memo is copied as often as the size of all doubles. And what is damaged, or left by a killed run.
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

/// Two runs may merge the same segments at the same time: both then hold all their memos. A reader that has
/// listed a segment before it was removed lists again.
void BuildMemo::merge() {
  const std::vector<std::uint32_t> chosen = segments_to_merge();
  const std::set<std::uint32_t> merged(chosen.begin(), chosen.end());
  for (const Place& place : places_) {
    if (!merged.contains(place.segment)) continue;
    // A later memo may be in the new segment by now: the time tells which counts.
    auto memo = segments_[place.segment]->memo(place.entry);
    if (!memo) continue;
    memo->keys = segments_[place.segment]->keys(place.entry);
    writer_->add(place.entry.name, *memo);
  }
  if (!writer_->finish()) return;
  for (const std::uint32_t i : merged) ::unlink(segments_[i]->path().c_str());
}

JobSelection::JobSelection(const BatchPlan& plan, const RunSettings& settings)
    : plan_(plan),
      settings_(settings),
      memo_(settings.cache.folder, plan.outputs),
      tool_seed_(program_build()) {}

std::vector<std::string> JobSelection::links_of(const PlannedModel& model) const {
  std::vector<std::string> folders = settings_.links_within;
  const std::string own = (fs::path(model.input).parent_path() / "").string();  // always allowed
  for (const std::string& folder : plan_.folders)
    if (model.input.starts_with(folder) && folder != own) folders.push_back(folder.empty() ? "." : folder);
  return folders;
}

const Sha256& JobSelection::request_of(const PlannedModel& model) {
  const std::vector<std::string> links = links_of(model);
  const auto [it, fresh] = requests_.try_emplace({model.profile.get(), links});
  if (fresh) {
    Key key("compile", 1);
    key.add("tool", tool_seed_).add("profile", *model.profile).add("strict", settings_.strict ? "1" : "0");
    for (const std::string& folder : links) key.add("links within " + folder, "1");
    it->second = key.digest();
  }
  return it->second;
}

void JobSelection::select(std::vector<WorkerReport>& reports) {
  for (std::size_t i = 0; i < plan_.models.size(); ++i) {
    const PlannedModel& m = plan_.models[i];
    const std::string package = package_within(plan_, m);
    PackageMemo memo;
    const bool remembered = memo_.find(package, memo);
    bool refreshed = false;
    if (remembered && memo.request == request_of(m) && !(memo.failed && settings_.retry_failed) &&
        still_holds(memo, m.input, m.output, refreshed)) {
      if (refreshed && !settings_.dry_run) {
        memo.keys = memo_.keys(package);
        memo_.set(package, memo);
      }
      recall(memo, reports[i]);
      continue;
    }
    if (remembered) memo.keys = memo_.keys(package);
    memos_[i] = std::move(memo);
    add_job(i, remembered);
  }
}

void JobSelection::recall(const PackageMemo& memo, WorkerReport& r) {
  recalled_failures_ += memo.failed;
  r.result = memo.failed ? ModelResult::kFailed : ModelResult::kUnchanged;
  r.bytes = memo.package_bytes;
  if (!memo.failed) r.made_s = memo.seconds, r.made_memory_bytes = memo.peak_memory_bytes;
  if (!settings_.depfile.empty()) r.more->files = memo.files;
  if (!memo.told.empty()) r.more->told = memo.told;
  if (const auto& e = memo.error; memo.failed && e.size() == 6)
    r.more->error = {e[0], e[1], e[2], e[3], e[4], e[5]};
}

void JobSelection::add_job(std::size_t i, bool remembered) {
  const PlannedModel& m = plan_.models[i];
  PackageMemo& memo = memos_[i];
  WorkerJob job;
  job.input = m.input;
  job.output = m.output;
  job.profile = m.profile;
  job.cache = settings_.cache;
  job.strict = settings_.strict;
  job.explain = settings_.explain;
  job.forecast = settings_.dry_run;
  job.links_within = links_of(m);
  if (remembered) {
    for (FileRequest& f : memo.files)
      if (f.found && f.stamp.is_settled(memo.looked_at_ns)) job.known.push_back(std::move(f));
    job.earlier_keys = std::move(memo.keys);
    memo.files = {};  // of 100,000 models there is no room for both
    memo.keys = {};
  }
  if (remembered && memo.peak_memory_bytes > 0) {
    job.predicted_memory_bytes = memo.peak_memory_bytes;
    job.predicted_s = memo.seconds;
  } else {
    const std::uint64_t bytes = bytes_of_file(m.input);
    job.predicted_memory_bytes = kBaseMemory_bytes + kMemoryPerByte * bytes;
    job.predicted_s = guessed_seconds(bytes);
  }
  jobs_.push_back(std::move(job));
  model_of_job_.push_back(i);
}

void JobSelection::tell_earlier_cost(std::size_t job, WorkerReport& report) const {
  const PackageMemo& earlier = memos_.at(model_of_job_[job]);
  if (!report.ok() || earlier.failed || report.stages_ran >= report.stages_hit) return;
  report.made_s = earlier.seconds;
  report.made_memory_bytes = earlier.peak_memory_bytes;
}

void JobSelection::remember(std::size_t job, const WorkerReport& report) {
  const std::size_t i = model_of_job_[job];
  if (report.more->files.empty() || (!report.ok() && !is_lasting(report))) return;
  const PlannedModel& m = plan_.models[i];
  PackageMemo memo;
  memo.request = request_of(m);
  memo.input_name = fs::path(m.input).filename().string();
  memo.failed = !report.ok();
  memo.told = report.more->told;
  memo.files = report.more->files;
  memo.peak_memory_bytes = report.peak_memory_bytes;
  memo.seconds = report.seconds;
  memo.keys = report.more->keys;
  const bool known = memos_[i].peak_memory_bytes > 0;
  // A run that found everything in the cache, or that failed on the way, says little about what the model
  // costs, and a failure nothing about what the stages that it did not reach would run with.
  if (known && (!report.ok() || report.stages_hit > report.stages_ran)) {
    memo.peak_memory_bytes = memos_[i].peak_memory_bytes;
    memo.seconds = memos_[i].seconds;
  }
  if (!report.ok()) memo.keys.insert(jobs_[job].earlier_keys.begin(), jobs_[job].earlier_keys.end());
  if (report.ok()) {
    const auto stamp = stamp_of(m.output);
    if (!stamp) return;
    memo.package_stamp = *stamp;
    memo.package_digest = report.package_digest;
    memo.package_bytes = report.bytes;
  } else {
    const ModelError& e = report.more->error;
    memo.error = {e.kind, e.file, e.place, e.expected, e.found, e.message};
  }
  memo.looked_at_ns = wall_clock_ns();
  memo_.set(package_within(plan_, m), memo);
}

}  // namespace texmesh
