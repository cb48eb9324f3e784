#include "stages/ladder/ladder.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "stages/base/parallel.h"
#include "stages/image/check_pixels.h"
#include "stages/ladder/rung_hull.h"
#include "stages/ladder/size_knots.h"

namespace texmesh {
namespace {

// Rungs are packed by at most this many per model in tables.bin, and more than that buys nothing (16
// rungs gain 0.1 dB over 10).
constexpr std::size_t kMaxRungs = 16;
constexpr std::size_t kFragmentsPerTask = 1;

[[noreturn]] void fail(std::string place, std::string expected, std::string found) {
  throw StageError("ladder", std::move(place), std::move(expected), std::move(found));
}

const std::vector<int>& rungs_of(TextureRole role, const LadderOptions& options) {
  if (is_colour(role)) return options.rungs;
  if (role == TextureRole::kNormal) return options.normal_rungs;
  return role == TextureRole::kAlpha ? options.alpha_rungs : options.data_rungs;
}

void check_rungs(const std::vector<int>& rungs, const char* name) {
  if (rungs.empty() || rungs.size() > kMaxRungs)
    fail(name, "1.." + std::to_string(kMaxRungs) + " qualities", std::to_string(rungs.size()));
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    if (rungs[r] < 1 || rungs[r] > 100) fail(name, "1..100", std::to_string(rungs[r]));
    if (r > 0 && rungs[r] <= rungs[r - 1])
      fail(name, "more than " + std::to_string(rungs[r - 1]), std::to_string(rungs[r]));
  }
}

void check(const Fragments& fragments, const std::vector<Pixels>& pixels, const Previews& previews,
           const LadderOptions& options) {
  check_rungs(options.rungs, "rungs");
  check_rungs(options.normal_rungs, "normal_rungs");
  check_rungs(options.data_rungs, "data_rungs");
  check_rungs(options.alpha_rungs, "alpha_rungs");
  check_pixels("ladder", fragments, pixels);
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const std::string place = "plane " + std::to_string(p);
    if (plane.covered_texels.size() != plane.fragment_count())
      fail(place + ": covered texels", std::to_string(plane.fragment_count()) + " fragments",
           std::to_string(plane.covered_texels.size()));
    if (plane.mip > 0 && options.hull_gain >= 0 &&
        (plane.base >= previews.planes.size() || previews.planes[plane.base].file.empty()))
      fail(place, "a preview of the full size", "none");
  }
}

/// With the coverage where some texels are not covered and these are free.
PixelWindow window_of(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                      std::size_t fragment) {
  const auto column = static_cast<std::uint32_t>(fragment % plane.columns);
  const auto row = static_cast<std::uint32_t>(fragment / plane.columns);
  const std::uint32_t left = column * plane.fragment_width_px, top = row * plane.fragment_height_px;
  CoverageWindow coverage;
  const bool some = plane.covered_texels[fragment] < plane.fragment_width_px * plane.fragment_height_px;
  if (some && uncovered == Uncovered::kFree && !plane.coverage.empty())
    coverage = {CoverageMask(plane), left, top};
  return {pixels.at(left, top), std::size_t{pixels.width_px} * pixels.channels, plane.fragment_width_px,
          plane.fragment_height_px, coverage};
}

/// What codes a plane, with a note where it is not what the mode asks for.
Codec codec_of(const TexturePlane& plane, std::size_t index, LadderMode mode, Notes& notes) {
  const auto stays = [&](const char* code, const std::string& why, Severity severity = Severity::kInfo) {
    notes.push_back(
        {severity, code, "texture plane " + std::to_string(index), why + ": it is coded as baseline JPEG"});
    return Codec::kJpeg;
  };
  if (mode == LadderMode::kProgressive) {
    if (std::min(plane.fragment_width_px, plane.fragment_height_px) >= kLeastProgressiveSide)
      return Codec::kJpegProgressive;
    return stays("small-fragments-not-progressive",
                 "fragments of " + std::to_string(plane.fragment_width_px) + " x " +
                     std::to_string(plane.fragment_height_px) + " px are too small for progressive files",
                 plane.mip == 0 ? Severity::kWarning : Severity::kInfo);
  }
  if (mode == LadderMode::kWebp) {
    if (is_colour(plane.role) && plane.channels == 3) return Codec::kWebp;
    return stays("not-webp", "WebP halves the chroma resolution of everything and has no grey");
  }
  return Codec::kJpeg;
}

PlaneCoding coding_of(const TexturePlane& plane, Codec codec, const LadderOptions& options) {
  PlaneCoding coding;
  coding.channels = plane.channels;
  coding.fragment_width_px = plane.fragment_width_px;
  coding.fragment_height_px = plane.fragment_height_px;
  coding.colour = is_colour(plane.role);
  coding.subsampling = options.subsampling;
  coding.qualities = rungs_of(plane.role, options);
  if (codec == Codec::kJpegProgressive && coding.colour) coding.qualities = {options.progressive_quality};
  return coding;
}

/// What samples show of a plane: this part of its pixels, but at least so many.
constexpr std::uint64_t kSampleDivisor = 16, kLeastSamplePixels = 131072;

std::vector<std::size_t> covered_fragments(const TexturePlane& plane) {
  std::vector<std::size_t> out;
  for (std::size_t f = 0; f < plane.covered_texels.size(); ++f)
    if (plane.covered_texels[f] > 0) out.push_back(f);
  return out;
}

void cut(PixelWindow& window, std::uint32_t channels, std::uint32_t left, std::uint32_t top,
         std::uint32_t width, std::uint32_t height) {
  window.data += top * window.stride_bytes + std::size_t{left} * channels;
  window.coverage.left_px += left;
  window.coverage.top_px += top;
  window.width_px = width;
  window.height_px = height;
}

/// What tables are trained on: the middle rows of covered fragments, evenly spread in index order, together
/// as many pixels as wanted where there are so many. More of them and smaller ones show more of the plane for
/// the same work. Whole rows, because the DC step from a row's end to the next row's begin is large: narrower
/// windows would show it too often, and the DC tables would be made for it.
std::vector<PixelWindow> training_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered,
                                         int wanted) {
  const std::vector<std::size_t> covered = covered_fragments(plane);
  const std::uint64_t budget =
      std::max(std::uint64_t{pixels.width_px} * pixels.height_px / kSampleDivisor, kLeastSamplePixels);
  const std::size_t count = std::min(covered.size(), static_cast<std::size_t>(std::max(wanted, 1)));
  constexpr std::uint32_t kRows = 16;
  std::uint32_t height = kRows;
  while (height < plane.fragment_height_px &&
         std::uint64_t{height + kRows} * plane.fragment_width_px * count <= budget)
    height += kRows;
  std::vector<PixelWindow> sample;
  for (std::size_t k = 0; k < count; ++k) {
    PixelWindow window =
        window_of(plane, pixels, uncovered, covered[(2 * k + 1) * covered.size() / (2 * count)]);
    const std::uint32_t above = (window.height_px - height) / (2 * kRows) * kRows;
    cut(window, plane.channels, 0, above, window.width_px, height);
    sample.push_back(window);
  }
  return sample;
}

/// What tells how bytes grow between rungs: tiles of 64 x 16 px all over the covered fragments, one of every
/// few at places that follow no pattern. Whole rows show too few places: of 1024 px they leave 1.3 % of error
/// where tiles leave .6.
std::vector<PixelWindow> size_sample(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered) {
  constexpr std::uint32_t kHeight = 16;
  constexpr std::uint64_t kMostSamplePixels = 1 << 20;
  const std::vector<std::size_t> covered = covered_fragments(plane);
  const std::uint32_t width = std::min(plane.fragment_width_px, 64u);
  const std::uint32_t across = (plane.fragment_width_px + width - 1) / width;
  const std::size_t in_fragment = std::size_t{across} * (plane.fragment_height_px / kHeight);
  const std::size_t tiles = covered.size() * in_fragment;
  const std::uint64_t all_pixels = std::uint64_t{tiles} * width * kHeight;
  const std::uint64_t wanted = std::clamp(all_pixels / kSampleDivisor, kLeastSamplePixels, kMostSamplePixels);
  const std::size_t step = std::max<std::size_t>(all_pixels / wanted, 1);
  std::vector<PixelWindow> sample;
  for (std::uint32_t k = 0; (k + 1) * step <= tiles; ++k) {
    const std::uint64_t part = k * 0x9e3779b1u;  // the golden section of 2^32: spread evenly
    const std::size_t tile = k * step + (part * step >> 32);
    const std::size_t fragment = covered[tile / in_fragment], place = tile % in_fragment;
    PixelWindow window = window_of(plane, pixels, uncovered, fragment);
    const auto left = static_cast<std::uint32_t>(place % across) * width;
    cut(window, plane.channels, std::min(left, window.width_px - width),
        static_cast<std::uint32_t>(place / across) * kHeight, width, kHeight);
    sample.push_back(window);
  }
  return sample;
}

/// What is encoded of one plane.
struct PlaneWork {
  std::vector<std::uint8_t> wanted;  // by fragment, 1 or 0; empty: the plane is left alone
  std::vector<std::size_t> rungs;    // of the codec's; empty: all
  std::vector<LadderRung> known;     // fragments stored there are taken as they are
};

/// A few neighbouring fragments at every rung: what one thread encodes at a time.
struct EncodeTask {
  std::size_t plane, first, last;
};

std::vector<EncodeTask> encode_tasks(const Fragments& fragments, const std::vector<PlaneWork>& work) {
  std::vector<EncodeTask> tasks;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    for (std::size_t f = 0; !work[p].wanted.empty() && f < fragments.planes[p].fragment_count();
         f += kFragmentsPerTask)
      tasks.push_back({p, f, std::min(f + kFragmentsPerTask, fragments.planes[p].fragment_count())});
  return tasks;
}

/// Streams of one task, on their way into the rungs.
struct Encoded {
  std::vector<std::vector<std::uint8_t>> data;   // [rung]: streams one after the other
  std::vector<std::vector<std::uint64_t>> ends;  // [rung][fragment - first] within data
};

/// Encoders that no thread uses at the moment. Tasks come plane by plane, so those of other planes go.
class EncoderPool {
 public:
  EncoderPool(const std::vector<std::unique_ptr<TextureCodec>>& codecs, const std::vector<PlaneWork>& work)
      : codecs_(codecs), work_(work) {}
  std::unique_ptr<FragmentEncoder> take(std::size_t plane) {
    const std::lock_guard lock(mutex_);
    if (plane > plane_) {
      plane_ = plane;
      free_.clear();
    }
    if (plane < plane_ || free_.empty()) return codecs_[plane]->encoder(work_[plane].rungs);
    auto encoder = std::move(free_.back());
    free_.pop_back();
    return encoder;
  }
  void give_back(std::size_t plane, std::unique_ptr<FragmentEncoder> encoder) {
    const std::lock_guard lock(mutex_);
    if (plane == plane_) free_.push_back(std::move(encoder));
  }

 private:
  const std::vector<std::unique_ptr<TextureCodec>>& codecs_;
  const std::vector<PlaneWork>& work_;
  std::mutex mutex_;
  std::size_t plane_ = 0;
  std::vector<std::unique_ptr<FragmentEncoder>> free_;
};

/// Puts the streams into the rungs in the order of the tasks, whichever thread is done first. Tasks are also
/// begun in order, so there are never more than a few waiting.
class OrderedRungs {
 public:
  OrderedRungs(std::vector<PlaneLadder>& planes, const std::vector<EncodeTask>& tasks)
      : planes_(planes), tasks_(tasks) {}
  void add(std::size_t task, Encoded encoded) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(task, std::move(encoded));
    for (auto it = waiting_.begin(); it != waiting_.end() && it->first == next_; it = waiting_.erase(it))
      append(it->second, planes_[tasks_[next_++].plane]);
  }

 private:
  static void append(const Encoded& encoded, PlaneLadder& plane) {
    for (std::size_t r = 0; r < plane.rungs.size(); ++r) {
      LadderRung& rung = plane.rungs[r];
      const std::uint64_t base = rung.data.size();
      for (const std::uint64_t end : encoded.ends[r]) rung.offset.push_back(base + end);
      rung.data.insert(rung.data.end(), encoded.data[r].begin(), encoded.data[r].end());
    }
  }
  std::vector<PlaneLadder>& planes_;
  const std::vector<EncodeTask>& tasks_;
  std::mutex mutex_;
  std::size_t next_ = 0;
  std::map<std::size_t, Encoded> waiting_;
};

/// Whether the fragment was there.
bool take_known(const std::vector<LadderRung>& known, std::size_t fragment, Encoded& out) {
  if (known.empty() || fragment_stream(known[0], fragment).empty()) return false;
  for (std::size_t r = 0; r < known.size(); ++r) {
    const auto stream = fragment_stream(known[r], fragment);
    out.data[r].insert(out.data[r].end(), stream.begin(), stream.end());
  }
  return true;
}

Encoded encode_task(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered, std::size_t rungs,
                    const PlaneWork& work, const EncodeTask& task, FragmentEncoder& encoder) {
  Encoded out;
  out.data.resize(rungs);
  out.ends.resize(rungs);
  for (std::size_t f = task.first; f < task.last; ++f) {
    if (work.wanted[f] && plane.covered_texels[f] > 0 && !take_known(work.known, f, out))
      encoder.encode(window_of(plane, pixels, uncovered, f), out.data);
    for (std::size_t r = 0; r < rungs; ++r) out.ends[r].push_back(out.data[r].size());
  }
  return out;
}

struct Progress {
  double begin, end;
};

void encode_planes(const Fragments& fragments, const std::vector<Pixels>& pixels, Uncovered uncovered,
                   const std::vector<std::unique_ptr<TextureCodec>>& codecs,
                   const std::vector<PlaneWork>& work, std::vector<PlaneLadder>& planes, Progress progress,
                   const RunContext& context) {
  const std::vector<EncodeTask> tasks = encode_tasks(fragments, work);
  EncoderPool encoders(codecs, work);
  OrderedRungs rungs(planes, tasks);
  std::atomic<std::size_t> next{0}, done{0};
  parallel_for(context, tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t t = next++;  // in order, whatever part of the range a thread was given
      const std::size_t p = tasks[t].plane;
      auto encoder = encoders.take(p);
      rungs.add(t, encode_task(fragments.planes[p], pixels[p], uncovered, planes[p].rungs.size(), work[p],
                               tasks[t], *encoder));
      encoders.give_back(p, std::move(encoder));
      const double part = static_cast<double>(++done) / static_cast<double>(tasks.size());
      context.report(progress.begin + (progress.end - progress.begin) * part);
    }
  });
}

/// First what choosing the rungs takes: of mips a few fragments.
std::vector<PlaneWork> first_work(const Fragments& fragments, double hull_gain) {
  std::vector<PlaneWork> work(fragments.planes.size());
  std::vector<std::vector<std::uint8_t>> sample = hull_sample(fragments);
  for (std::size_t p = 0; p < work.size(); ++p) {
    if (hull_gain < 0) sample[p].assign(sample[p].size(), 1);
    work[p].wanted = std::move(sample[p]);
  }
  return work;
}

/// Then, at the rungs that stay, what mips lack. What they have moves from the ladder to the work.
std::vector<PlaneWork> remaining_work(const std::vector<PlaneWork>& before,
                                      std::vector<std::vector<std::size_t>> kept,
                                      std::vector<PlaneLadder>& planes) {
  std::vector<PlaneWork> work(before.size());
  for (std::size_t p = 0; p < work.size(); ++p) {
    const std::vector<std::uint8_t>& had = before[p].wanted;
    if (std::find(had.begin(), had.end(), 0) == had.end()) continue;
    work[p].wanted.assign(had.size(), 1);
    work[p].rungs = std::move(kept[p]);
    for (LadderRung& rung : planes[p].rungs) {
      LadderRung empty{rung.quality, rung.tables, {}, {0}};
      work[p].known.push_back(std::exchange(rung, std::move(empty)));
    }
  }
  return work;
}

}  // namespace

Ladder encode_ladder(const Fragments& fragments, const std::vector<Pixels>& pixels, const Previews& previews,
                     const LadderOptions& options, const RunContext& context) {
  check(fragments, pixels, previews, options);
  const std::size_t planes = fragments.planes.size();
  Ladder ladder;
  ladder.planes.resize(planes);
  std::vector<std::unique_ptr<TextureCodec>> codecs(planes);
  for (std::size_t p = 0; p < planes; ++p) {
    const TexturePlane& plane = fragments.planes[p];
    PlaneLadder& out = ladder.planes[p];
    out.codec = codec_of(plane, p, options.mode, ladder.notes);
    const PlaneCoding coding = coding_of(plane, out.codec, options);
    codecs[p] = make_texture_codec(out.codec, coding);
    const auto training = training_sample(plane, pixels[p], options.uncovered, options.training_fragments);
    for (CodecRung& rung : codecs[p]->train(training, context))
      out.rungs.push_back({rung.quality, std::move(rung.tables), {}, {0}});
    if (out.codec == Codec::kJpeg && is_colour(plane.role) && plane.mip == 0)
      out.knots = measure_size_knots(coding, size_sample(plane, pixels[p], options.uncovered), context);
    context.report(0.15 * static_cast<double>(p + 1) / static_cast<double>(planes));
  }
  const auto encode = [&](const std::vector<PlaneWork>& work, Progress progress) {
    encode_planes(fragments, pixels, options.uncovered, codecs, work, ladder.planes, progress, context);
  };
  const std::vector<PlaneWork> first = first_work(fragments, options.hull_gain);
  encode(first, {0.15, 0.85});
  auto kept = drop_rungs_off_hull(fragments, pixels, previews, options.hull_gain, ladder, context);
  encode(remaining_work(first, std::move(kept), ladder.planes), {0.9, 1});
  return ladder;
}

}  // namespace texmesh
