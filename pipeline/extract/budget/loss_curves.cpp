#include "pipeline/extract/budget/loss_curves.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr double kPower = 2;
constexpr double kUsualQuality = 65;
constexpr double kTypicalTexelsPerByte = 6;  // at the usual quality
constexpr std::uint32_t kTiny = 8;
constexpr double kFewBytes = 16000;

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

double joined(double loss) { return loss > 0 ? portable::pow(loss, kPower) : 0; }
double unjoined(double sum) { return sum > 0 ? portable::pow(sum, 1 / kPower) : 0; }

void LossCurves::render(const std::vector<Trial>& trials) {
  std::vector<CodedImage> found(trials.size());
  std::vector<const Pixels*> pixels;
  for (const Trial& t : trials) pixels.push_back(&coder_.texels(t.image, t.step));
  RunContext serial = source_.context;
  serial.threads = 1;
  parallel_for(source_.context, trials.size(), 4, [&](std::size_t begin, std::size_t end) {
    std::vector<RenderTexture> textures = source_.best_textures;
    for (std::size_t k = begin; k < end; ++k) {
      const Trial& t = trials[k];
      const FileImageData file = coder_.encoded(t.image, *pixels[k], t.coding, t.quality, true);
      coder_.show(t.image, file, textures, serial);
      found[k] = {{t.coding, size_step(t.step), t.quality},
                  static_cast<double>((file.bytes.size() + 3) / 4 * 4),
                  joined(source_.window_meter->difference(*source_.finest_windows, textures, serial))};
      for (std::size_t s = 0; s < source_.shown.size(); ++s)
        if (source_.shown[s].image == t.image) textures[s] = source_.best_textures[s];
    }
  });
  for (std::size_t k = 0; k < trials.size(); ++k) {
    if (getenv("TXL")) fprintf(stderr, "%.2f  img %zu step %d c%d%d q%.0f bytes %.0f loss %.5f\n", clock()*1e-6, trials[k].image, trials[k].step, (int)trials[k].coding.format, trials[k].coding.full_chroma, trials[k].quality, found[k].bytes, unjoined(found[k].loss));
    seen_[trials[k].image].push_back(found[k]);
  }
}

std::vector<LossCurves::Trial> LossCurves::first_trials(double bytes) const {
  double weights = 0;
  for (std::size_t i = 0; i < source_.image_count(); ++i) weights += weight_of(source_.image(i));
  std::vector<Trial> out;
  for (std::size_t i = 0; i < source_.image_count(); ++i) {
    const PackageImage& image = source_.image(i);
    const double wanted = bytes * weight_of(image) / weights * kTypicalTexelsPerByte;
    int step = 0;
    while (step + 2 < last_step(image) && texels_of(image) * size_step(step) * size_step(step) > wanted) step += 2;
    out.push_back({i, step, coder_.codings(i).front(), kUsualQuality});
    if (step != last_step(image)) out.push_back({i, last_step(image), out.back().coding, kUsualQuality});
  }
  return out;
}

/// Sizes and qualities around that of one file seen, whose bytes are likely to be less than all there are.
void LossCurves::add_trials(std::size_t image, const CodedImage& seen, double bytes,
                            std::vector<Trial>& out) const {
  double weights = 0;
  for (std::size_t i = 0; i < source_.image_count(); ++i) weights += weight_of(source_.image(i));
  const double wanted = bytes * weight_of(source_.image(image)) / weights;
  int from = 0;
  while (size_step(from) > seen.plan.share) ++from;
  const auto bytes_at = [&](int step, double quality) {
    return seen.bytes * portable::exp(portable::log(2) * (from - step) + (quality - kUsualQuality) / 32);
  };
  int middle = from;
  while (middle > 0 && bytes_at(middle, kUsualQuality) < wanted * 0.7) --middle;
  while (middle < last_step(source_.image(image)) && bytes_at(middle, kUsualQuality) > wanted * 1.4) ++middle;
  const auto add = [&](int step, const TextureCoding& coding, double quality) {
    const int bounded = std::clamp(step, 0, last_step(source_.image(image)));
    if (bounded != step) quality = std::clamp(quality + 16 * (bounded - step), 5.0, 98.0);
    if (coding.format == FileImage::kPng) quality = 100;
    const bool same = std::any_of(out.begin(), out.end(), [&](const Trial& t) {
      return t.image == image && t.step == bounded && t.quality == quality && t.coding == coding;
    });
    const bool known = std::any_of(seen_[image].begin(), seen_[image].end(), [&](const CodedImage& c) {
      return c.plan.share == size_step(bounded) && c.plan.quality == quality && c.plan.coding == coding;
    });
    if (!same && !known && bytes_at(bounded, quality) < 1.1 * bytes) out.push_back({image, bounded, coding, quality});
  };
  const std::vector<TextureCoding> codings = coder_.codings(image);
  // Halves: smaller copies of other sizes lie beside their place.
  middle -= middle % 2;
  for (const double quality : {35.0, kUsualQuality}) add(middle - 2, codings[0], quality);
  for (const double quality : {35.0, kUsualQuality, 85.0}) add(middle, codings[0], quality);
  for (const double quality : {kUsualQuality, 85.0}) add(middle + 2, codings[0], quality);
  add(middle + 4, codings[0], kUsualQuality);
  // Other codings are worth a look where there are few bytes.
  for (std::size_t k = 1; k < codings.size(); ++k)
    if (wanted < kFewBytes) add(middle, codings[k], kUsualQuality);
}

void LossCurves::measure(double bytes) {
  seen_.assign(source_.image_count(), {});
  const std::vector<Trial> first = first_trials(std::max(bytes, 1.0));
  render(first);
  std::vector<Trial> more;
  for (std::size_t i = 0; i < source_.image_count(); ++i)
    add_trials(i, seen_[i].front(), std::max(bytes, 1.0), more);
  render(more);
  curves_.clear();
  for (const std::vector<CodedImage>& files : seen_) curves_.push_back(convex(files));
}

Allocation LossCurves::allocate(double bytes) const {
  Allocation out;
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
      const double gain = (a.loss - b.loss) / (b.bytes - a.bytes);
      if (gain > best) best = gain, next = i;
    }
    if (next == curves_.size()) break;
    const CodedImage &a = curves_[next][at[next]], &b = curves_[next][at[next] + 1];
    out.last = next;
    if (out.bytes + b.bytes - a.bytes > bytes) {
      const double part = std::clamp((bytes - out.bytes) / (b.bytes - a.bytes), 0.0, 1.0);
      CodedImage& image = out.images[next];
      if (part > 0.5) image.plan = b.plan;
      image.bytes = a.bytes + part * (b.bytes - a.bytes);
      image.loss = a.loss + part * (b.loss - a.loss);
      out.bytes += image.bytes - a.bytes;
      break;
    }
    out.images[next] = b;
    out.bytes += b.bytes - a.bytes;
    ++at[next];
  }
  for (const CodedImage& image : out.images) out.loss += image.loss;
  return out;
}

}  // namespace texmesh
