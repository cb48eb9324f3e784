#include "stages/ladder/encode_rungs.h"

#include <atomic>
#include <map>
#include <mutex>
#include <utility>

#include "format/base/bytes.h"
#include "stages/base/parallel.h"
#include "stages/ladder/fragment_windows.h"

namespace texmesh {
namespace {

/// What one thread encodes at a time: a fragment at every rung.
struct EncodeTask {
  std::size_t plane, fragment;
};

std::vector<EncodeTask> encode_tasks(const std::vector<PlaneWork>& work) {
  std::vector<EncodeTask> tasks;
  for (std::size_t p = 0; p < work.size(); ++p)
    for (std::size_t f = 0; f < work[p].wanted.size(); ++f) tasks.push_back({p, f});
  return tasks;
}

/// Encoders that no thread uses at the moment. Tasks come plane by plane, so encoders of earlier planes are
/// dropped.
class EncoderPool {
 public:
  EncoderPool(const std::vector<TrainedPlane>& trained, const std::vector<PlaneWork>& work)
      : trained_(trained), work_(work) {}
  std::unique_ptr<FragmentEncoder> borrow(std::size_t plane) {
    const std::lock_guard lock(mutex_);
    if (plane > plane_) {
      plane_ = plane;
      free_.clear();
    }
    if (plane < plane_ || free_.empty()) return trained_[plane].codec->encoder(work_[plane].rungs);
    auto encoder = std::move(free_.back());
    free_.pop_back();
    return encoder;
  }
  void give_back(std::size_t plane, std::unique_ptr<FragmentEncoder> encoder) {
    const std::lock_guard lock(mutex_);
    if (plane == plane_) free_.push_back(std::move(encoder));
  }

 private:
  const std::vector<TrainedPlane>& trained_;
  const std::vector<PlaneWork>& work_;
  std::mutex mutex_;
  std::size_t plane_ = 0;
  std::vector<std::unique_ptr<FragmentEncoder>> free_;
};

using Streams = std::vector<Bytes>;  // of one fragment, by rung

/// Puts streams into the rungs in the order of the tasks, whichever thread is done first. Tasks are also
/// begun in order, so there are never more than a few waiting.
class OrderedStreams {
 public:
  OrderedStreams(std::vector<PlaneLadder>& planes, const std::vector<EncodeTask>& tasks)
      : planes_(planes), tasks_(tasks) {}
  void add(std::size_t task, Streams streams) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(task, std::move(streams));
    for (auto it = waiting_.begin(); it != waiting_.end() && it->first == next_; it = waiting_.erase(it))
      append(it->second, planes_[tasks_[next_++].plane]);
  }

 private:
  static void append(const Streams& streams, PlaneLadder& plane) {
    for (std::size_t r = 0; r < streams.size(); ++r) {
      LadderRung& rung = plane.rungs[r];
      rung.data.insert(rung.data.end(), streams[r].begin(), streams[r].end());
      rung.offset.push_back(rung.data.size());
    }
  }
  std::vector<PlaneLadder>& planes_;
  const std::vector<EncodeTask>& tasks_;
  std::mutex mutex_;
  std::size_t next_ = 0;
  std::map<std::size_t, Streams> waiting_;
};

/// Those of the fragment; none where it is not stored.
Streams known_streams(const std::vector<LadderRung>& known, std::size_t fragment) {
  Streams out;
  if (known.empty() || fragment_stream(known[0], fragment).empty()) return out;
  for (const LadderRung& rung : known) {
    const auto stream = fragment_stream(rung, fragment);
    out.emplace_back(stream.begin(), stream.end());
  }
  return out;
}

/// The ladders before their first stream.
std::vector<PlaneLadder> empty_ladders(const std::vector<TrainedPlane>& trained,
                                       std::vector<PlaneWork>& work) {
  std::vector<PlaneLadder> planes(trained.size());
  for (std::size_t p = 0; p < planes.size(); ++p) {
    planes[p].codec = trained[p].codec->id();
    planes[p].source_rung = trained[p].source_rung;
    if (work[p].wanted.empty()) {
      planes[p].rungs = std::move(work[p].known);
      continue;
    }
    for (const std::size_t r : work[p].rungs)
      planes[p].rungs.push_back({trained[p].rungs[r].quality, trained[p].rungs[r].table_stream, {}, {0}});
  }
  return planes;
}

}  // namespace

std::vector<PlaneLadder> encode_rungs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                      Uncovered uncovered, const std::vector<TrainedPlane>& trained,
                                      std::vector<PlaneWork> work, ProgressPart progress,
                                      const RunContext& context) {
  const std::vector<EncodeTask> tasks = encode_tasks(work);
  std::vector<PlaneLadder> planes = empty_ladders(trained, work);
  EncoderPool encoders(trained, work);
  OrderedStreams ordered(planes, tasks);
  std::atomic<std::size_t> next{0}, done{0};
  parallel_for(context, tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t t = next++;  // in order, whatever part of the range a thread was given
      const auto [p, f] = tasks[t];
      Streams streams = known_streams(work[p].known, f);
      if (streams.empty()) {
        streams.resize(work[p].rungs.size());
        if (work[p].wanted[f] && fragments.planes[p].covered_texels[f] > 0) {
          auto encoder = encoders.borrow(p);
          encoder->encode(fragment_window(fragments.planes[p], trained[p].coded(pixels[p]), uncovered, f),
                          streams);
          encoders.give_back(p, std::move(encoder));
        }
      }
      ordered.add(t, std::move(streams));
      const double part = static_cast<double>(++done) / static_cast<double>(tasks.size());
      context.report(progress.begin + (progress.end - progress.begin) * part);
    }
  });
  return planes;
}

}  // namespace texmesh
