#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/batch/memo/memo_record.h"
#include "pipeline/batch/memo/memo_segment.h"

namespace texmesh {

/// The memos of the packages of one output folder (or of one single package): a folder of segments in the
/// cache folder. Each run appends to a segment of its own, and every run reads all of them, so runs on
/// several machines need no lock and wait for nothing. Of two records of a package the later one counts.
/// Losing any of it costs looking models over again in their child processes, never a wrong result. Not
/// thread-safe.
///
/// In memory: 56 bytes a record that was read. Written: what has changed; a run that has written something
/// also merges segments of about the same size once there are many, so that a record is copied a few times in
/// its life.
class BuildMemo {
 public:
  /// `outputs`: absolute path of the output folder, or of the package where a run makes one only. Without a
  /// cache folder nothing is remembered.
  BuildMemo(const std::string& cache_folder, const std::string& outputs);
  /// Saves what is left to save, and merges.
  ~BuildMemo();
  BuildMemo(const BuildMemo&) = delete;
  BuildMemo& operator=(const BuildMemo&) = delete;

  /// Some segment has bytes without their digest: what they said is not remembered.
  bool was_damaged() const;
  /// `package`: its path within the output folder. Finds what had been saved when this object was made.
  /// The record's keys are left out.
  bool find(const std::string& package, MemoRecord& record) const;
  /// The keys of the record that find() finds.
  StageKeys keys(const std::string& package) const;
  void set(const std::string& package, const MemoRecord& record);
  /// Others can read from now on what was set. False when it cannot be written.
  bool save();

 private:
  struct Place {
    MemoEntry entry;
    std::uint32_t segment = 0;
  };
  bool read_all();
  void keep_latest();
  const Place* place_of(const std::string& package) const;
  std::vector<std::uint32_t> segments_to_merge() const;
  void merge();

  std::string folder_;
  std::vector<std::unique_ptr<MemoSegment>> segments_;
  std::vector<Place> places_;  // by name, each once
  std::unique_ptr<MemoSegmentWriter> writer_;
  bool wrote_ = false;
};

}  // namespace texmesh
