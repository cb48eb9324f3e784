#include "tools/extract/budget/loss_curves.h"

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kUsualQuality = 65;
constexpr double kTypicalTexelsPerByte = 6;  // at the usual quality
constexpr std::uint32_t kTiny = 8;
constexpr double kFewBytes = 16000;                    // of an image: other codings are worth a look
constexpr double kWebpQuality = 65, kWebpShare = 0.4;  // of a JPEG's bytes at the same quality
constexpr double kMuch = 0.15, kLittle = 0.05;         // of all images' losses
constexpr int kWeightings = 3;
constexpr double kFarAbove = 4;  // of an image's bytes: stored coefficients would have to lose most of theirs

/// Files that lie on the lower convex border, by rising bytes.
std::vector<CodedImage> convex(std::vector<CodedImage> files) {
  std::stable_sort(files.begin(), files.end(), [](const CodedImage& a, const CodedImage& b) {
    return a.bytes != b.bytes ? a.bytes < b.bytes : a.loss < b.loss;
  });
  std::vector<CodedImage> out;
  for (const CodedImage& f : files) {
    if (!out.empty() && f.loss >= out.back().loss) continue;
    while (out.size() >= 2) {
      const CodedImage &a = out[out.size() - 2], &b = out.back();
      if ((b.loss - a.loss) * (f.bytes - a.bytes) < (f.loss - a.loss) * (b.bytes - a.bytes)) break;
      out.pop_back();
    }
    out.push_back(f);
  }
  return out;
}

/// Part of the bytes for textures that images of a role are likely to get, before anything is measured.
double weight_of(const PackageImage& image) {
  return image.colours ? 1.0 : image.role == "normal" ? 0.7 : 0.25;
}

double texels_of(const PackageImage& image) {
  return static_cast<double>(image.width_px) * static_cast<double>(image.height_px);
}

/// The step at which a side is tiny.
int last_step(const PackageImage& image) {
  int step = 0;
  while (step + 1 < kSizeSteps && side_of(std::max(image.width_px, image.height_px), size_step(step)) > kTiny)
    ++step;
  return step;
}

}  // namespace

/// The files of an image that are of use to look at, and new.
class LossCurves::Trials {
 public:
  Trials(const LossCurves& curves, std::size_t image, double bytes)
      : curves_(curves), image_(image), bytes_(bytes), last_(last_step(curves.reference_.images[image])) {}
  int last() const { return last_; }

  /// Bytes that a file is likely to have, from what was seen of the image.
  double likely(int step, double quality) const {
    const CodedImage& seen = curves_.seen_[image_].front();
    return seen.bytes * portable::exp(portable::log(2) * (step_of(seen.plan.share) - step) +
                                      (quality - seen.plan.quality) / 32);
  }
  static int step_of(double share) {
    int step = 0;
    while (step + 1 < kSizeSteps && size_step(step) > share) ++step;
    return step;
  }
  /// A size beyond the ends becomes one at the end with another quality.
  void add(int step, const TextureCoding& coding, double quality) {
    const int bounded = std::clamp(step, 0, last_);
    quality = std::clamp(quality + 16 * (bounded - step), 5.0, 98.0);
    if (coding.format == FileImage::kPng) quality = 100;
    const auto same = [&](const TextureCoding& c, double share, double q) {
      return c == coding && share == size_step(bounded) && q == quality;
    };
    for (const ImageTrial& t : list_)
      if (same(t.coding, size_step(t.step), t.quality)) return;
    for (const CodedImage& c : curves_.seen_[image_])
      if (same(c.plan.coding, c.plan.share, c.plan.quality)) return;
    if (likely(bounded, quality) < 1.1 * bytes_) list_.push_back({image_, bounded, coding, quality});
  }
  /// The source's own coefficients, and some less of them, where they are not far from `chosen` bytes.
  void add_stored(double stored_bytes, double chosen_bytes) {
    const TextureCoding stored{FileImage::kJpeg, false, true};
    if (stored_bytes < 1.1 * bytes_) list_.push_back({image_, 0, stored, kHighestQuality});
    if (stored_bytes < kFarAbove * chosen_bytes)
      for (const double quality : {80.0, 92.0}) list_.push_back({image_, 0, stored, quality});
  }
  void append_to(std::vector<ImageTrial>& all) const { all.insert(all.end(), list_.begin(), list_.end()); }

 private:
  const LossCurves& curves_;
  std::size_t image_;
  double bytes_;
  int last_;
  std::vector<ImageTrial> list_;
};

LossCurves::LossCurves(const Reference& reference, Candidates& candidates, double wanted)
    : reference_(reference), candidates_(candidates), seen_(reference.images.size()) {
  const double bytes = std::max(wanted, 1.0);
  look_at(first_trials(bytes));
  look_at(trials_around_first(bytes));
  find_curves();
  look_at(trials_around(allocate(bytes), bytes));
  find_curves();
}

void LossCurves::look_at(const std::vector<ImageTrial>& trials) {
  const std::vector<CodedImage> found = candidates_.measured(trials);
  for (std::size_t k = 0; k < trials.size(); ++k) seen_[trials[k].image].push_back(found[k]);
}

double LossCurves::likely_bytes(std::size_t image, double bytes) const {
  double weights = 0;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) weights += weight_of(reference_.images[i]);
  return bytes * weight_of(reference_.images[image]) / weights;
}

/// A likely size, and one of next to no bytes.
std::vector<ImageTrial> LossCurves::first_trials(double bytes) const {
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    const PackageImage& image = reference_.images[i];
    const TextureCoding coding = candidates_.codings(i).front();
    const double wanted = likely_bytes(i, bytes) * kTypicalTexelsPerByte;
    int step = 0;
    while (step + 2 < last_step(image) && texels_of(image) * size_step(step) * size_step(step) > wanted)
      step += 2;
    out.push_back({i, step, coding, kUsualQuality});
    if (step != last_step(image)) out.push_back({i, last_step(image), coding, kUsualQuality});
  }
  return out;
}

/// Sizes and qualities around the likely one. Halves: smaller copies of other sizes lie beside their place.
std::vector<ImageTrial> LossCurves::trials_around_first(double bytes) const {
  double sum = 0;
  for (const std::vector<CodedImage>& files : seen_) sum += files.front().loss;
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    Trials trials(*this, i, bytes);
    const double wanted = likely_bytes(i, bytes);
    int middle = 0;
    while (middle < trials.last() && trials.likely(middle, kUsualQuality) > wanted * 1.4) middle += 2;
    const TextureCoding coding = candidates_.codings(i).front();
    trials.add(middle, coding, 20);
    if (seen_[i].front().loss > kLittle * sum) {
      for (const double quality : {20.0, 45.0, kUsualQuality}) trials.add(middle - 2, coding, quality);
      for (const double quality : {40.0, kUsualQuality, 85.0}) trials.add(middle, coding, quality);
    }
    for (const double quality : {40.0, 75.0}) trials.add(middle + 2, coding, quality);
    trials.add(middle + 4, coding, kUsualQuality);
    trials.append_to(out);
  }
  return out;
}

/// About as many bytes in another way: sizes between halves where an image loses much, other codings where it
/// has few bytes.
std::vector<ImageTrial> LossCurves::trials_around(const DealtBytes& chosen, double bytes) const {
  double sum = 0;
  for (const CodedImage& image : chosen.images) sum += image.loss;
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    Trials trials(*this, i, bytes);
    const ImagePlan& plan = chosen.images[i].plan;
    const int step = Trials::step_of(plan.share);
    if (chosen.images[i].loss > kMuch * sum) {
      trials.add(step + 1, plan.coding, plan.quality + 20);
      trials.add(step - 1, plan.coding, plan.quality - 18);
    }
    const std::vector<TextureCoding> codings = candidates_.codings(i);
    const bool few = chosen.images[i].bytes < kFewBytes;
    for (std::size_t k = 1; few && k < codings.size(); ++k) {
      int middle = 0;
      while (middle < trials.last() && kWebpShare * trials.likely(middle, kWebpQuality) >
                                           std::max(chosen.images[i].bytes, 0.02 * bytes))
        middle += 2;
      trials.add(middle, codings[k], kWebpQuality);
      trials.add(middle + 2, codings[k], kWebpQuality);
    }
    if (const auto stored = candidates_.stored_bytes(i)) trials.add_stored(*stored, chosen.images[i].bytes);
    trials.append_to(out);
  }
  return out;
}

void LossCurves::find_curves() {
  curves_.clear();
  for (const std::vector<CodedImage>& files : seen_) curves_.push_back(convex(files));
}

std::vector<double> LossCurves::group_losses(const DealtBytes& allocation) const {
  std::vector<double> sums(reference_.images.size());
  for (std::size_t i = 0; i < allocation.images.size(); ++i)
    sums[reference_.groups[i]] += allocation.images[i].loss;
  for (double& s : sums) s = std::sqrt(s);
  return sums;
}

/// The sum of groups' losses is least where each image gains alike by its group's loss; which is known only
/// when the bytes are dealt out.
DealtBytes LossCurves::allocate(double bytes) const {
  DealtBytes best;
  std::vector<double> weights(reference_.images.size(), 1);
  for (int i = 0; i < kWeightings; ++i) {
    DealtBytes found = allocate(bytes, weights);
    weights = group_losses(found);
    double sum = 0;
    for (double& w : weights) {
      sum += w;
      w = 1 / std::max(w, 1e-4);
    }
    found.loss = joined(sum);
    if (i == 0 || found.loss < best.loss) best = std::move(found);
  }
  return best;
}

const CodedImage* LossCurves::neighbour(std::size_t image, const CodedImage& from, int step) const {
  const CodedImage* fewer = nullptr;
  for (const CodedImage& file : curves_[image]) {
    if (file.plan == from.plan) continue;
    if (step > 0 && file.bytes > from.bytes) return &file;
    if (step < 0 && file.bytes < from.bytes) fewer = &file;
  }
  return fewer;
}

DealtBytes LossCurves::allocate(double bytes, const std::vector<double>& group_weights) const {
  DealtBytes out;
  std::vector<std::size_t> at(curves_.size(), 0);
  for (const std::vector<CodedImage>& curve : curves_) {
    out.images.push_back(curve.front());
    out.bytes += curve.front().bytes;
  }
  for (;;) {
    double best = 0;
    std::size_t next = curves_.size();
    for (std::size_t i = 0; i < curves_.size(); ++i) {
      if (at[i] + 1 >= curves_[i].size()) continue;
      const CodedImage &a = curves_[i][at[i]], &b = curves_[i][at[i] + 1];
      const double gain = (a.loss - b.loss) / (b.bytes - a.bytes) * group_weights[reference_.groups[i]];
      if (gain > best) best = gain, next = i;
    }
    if (next == curves_.size()) return out;
    const CodedImage &a = curves_[next][at[next]], &b = curves_[next][at[next] + 1];
    out.last = next;
    const double part = std::clamp((bytes - out.bytes) / (b.bytes - a.bytes), 0.0, 1.0);
    CodedImage& image = out.images[next];
    image = {part > 0.5 ? b.plan : a.plan, a.bytes + part * (b.bytes - a.bytes),
             a.loss + part * (b.loss - a.loss)};
    out.bytes += image.bytes - a.bytes;
    if (part < 1) return out;
    ++at[next];
  }
}

}  // namespace texmesh
