#include "stages/ladder/ladder.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "stages/fragment_codec/coding_space.h"
#include "stages/image/check_pixels.h"
#include "stages/image/decode_image.h"
#include "stages/ladder/choose_rungs.h"
#include "stages/ladder/encode_rungs.h"
#include "stages/ladder/fragment_windows.h"
#include "stages/ladder/rung_loss.h"
#include "stages/ladder/size_knots.h"
#include "stages/ladder/source_codec.h"
#include "stages/ladder/source_difference.h"

namespace texmesh {
namespace {

// Rungs are packed by at most this many per model in tables.bin, and more than that buys nothing (16
// rungs gain 0.1 dB over 10).
constexpr std::size_t kMaxRungs = 16;
// Of the stage's progress, when codecs are trained, samples encoded, rungs chosen.
constexpr double kTrained = 0.15, kSampled = 0.85, kChosen = 0.9;

[[noreturn]] void fail(std::string place, std::string expected, std::string found) {
  throw StageError("ladder", std::move(place), std::move(expected), std::move(found));
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
           const std::vector<Image>& images, const LadderOptions& options) {
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
    const std::size_t base = plane.mip > 0 ? plane.base : p;
    if (options.prune && (base >= previews.planes.size() || previews.planes[base].file.empty()))
      fail(place, "a preview of the full size", "none");
    if (!images.empty() && plane.image >= images.size())
      fail(place, "its source image", std::to_string(images.size()) + " images");
  }
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
  coding.subsampling = is_colour(plane.role) ? options.subsampling : Subsampling::k444;
  coding.qualities = ladder_rungs(plane.role, options);
  if (codec == Codec::kJpegProgressive && is_colour(plane.role))
    coding.qualities = {options.progressive_quality};
  return coding;
}

/// The space of three channels of data, by what a sample of their pixels shows.
void choose_space(const TexturePlane& plane, const Pixels& pixels, Uncovered uncovered, PlaneCoding& coding,
                  const RunContext& context) {
  if (is_colour(plane.role) || plane.channels != 3) return;
  const CodingSpace space =
      measure_coding_space(plane.role == TextureRole::kNormal ? DataKind::kVectors : DataKind::kNumbers,
                           size_sample(plane, pixels, uncovered), context);
  coding.apart = space.apart;
  coding.subsampling = space.subsampling;
}

/// The codecs of all planes, trained on samples of their pixels.
std::vector<TrainedPlane> train_planes(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                       const std::vector<Image>& images, const LadderOptions& options,
                                       Notes& notes, const RunContext& context) {
  std::vector<TrainedPlane> out;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const Codec codec = codec_of(plane, p, options.mode, notes);
    TrainedPlane& trained = out.emplace_back();
    trained.coding = coding_of(plane, codec, options);
    if (codec == Codec::kJpeg && options.mode == LadderMode::kJpeg && !images.empty())
      trained.source = make_source_codec(plane, pixels[p], images[plane.image], options, context);
    if (trained.source.codec) {
      trained.codec = std::move(trained.source.codec);
      trained.source_rung = true;
    } else {
      choose_space(plane, pixels[p], options.uncovered, trained.coding, context);
      trained.codec = make_texture_codec(codec, trained.coding);
    }
    trained.rungs = trained.codec->train(
        training_sample(plane, pixels[p], options.uncovered, options.training_fragments), context);
    context.report(kTrained * static_cast<double>(p + 1) / static_cast<double>(fragments.planes.size()));
  }
  return out;
}

std::vector<std::vector<std::size_t>> all_rungs(const std::vector<TrainedPlane>& trained) {
  std::vector<std::vector<std::size_t>> out;
  for (const TrainedPlane& plane : trained) {
    std::vector<std::size_t>& rungs = out.emplace_back(plane.rungs.size());
    std::iota(rungs.begin(), rungs.end(), std::size_t{0});
  }
  return out;
}

/// Knots of full-size colours, between the rungs that are kept.
void measure_knots(const Fragments& fragments, const std::vector<Pixels>& pixels,
                   const LadderOptions& options, const std::vector<std::vector<std::size_t>>& kept,
                   std::vector<TrainedPlane>& trained, const RunContext& context) {
  for (std::size_t p = 0; p < trained.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (trained[p].codec->id() != Codec::kJpeg || !is_colour(plane.role) || plane.mip > 0) continue;
    PlaneCoding coding = trained[p].coding;
    coding.qualities.clear();
    for (const std::size_t r : kept[p]) coding.qualities.push_back(trained[p].rungs[r].quality);
    trained[p].knots =
        trained[p].source_rung
            ? size_knots(coding.qualities, trained[p].source.bits)
            : measure_size_knots(coding, size_sample(plane, pixels[p], options.uncovered), context);
  }
}

/// What choosing the rungs takes, at every rung: a few fragments, or all where there is no choice.
std::vector<PlaneWork> sample_work(const Fragments& fragments, const std::vector<TrainedPlane>& trained,
                                   bool prune) {
  std::vector<PlaneWork> work(trained.size());
  std::vector<std::vector<std::uint8_t>> sample;
  if (prune) sample = choice_sample(fragments);
  for (std::size_t p = 0; p < work.size(); ++p) {
    if (prune)
      work[p].wanted = std::move(sample[p]);
    else
      work[p].wanted.assign(fragments.planes[p].fragment_count(), 1);
    for (std::size_t r = 0; r < trained[p].rungs.size(); ++r) work[p].rungs.push_back(r);
  }
  return work;
}

/// Of the fragments that the rung holds.
double bytes_per_texel(const TexturePlane& plane, const LadderRung& rung) {
  double texels = 0;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (!fragment_stream(rung, f).empty()) texels += plane.covered_texels[f];
  return texels > 0 ? static_cast<double>(rung.data.size()) / texels : 0;
}

/// Takes rungs out of mips that pay much more for a texel than the source does, whose own coefficients are
/// there to be shown. Scans whose mips went up to quality 97 took 0.6 to 1.6 times the bytes of their source
/// for mips alone. The lowest rungs are left, one of each plane at least.
void leave_heavy_mips_out(const Fragments& fragments, std::vector<PlaneLadder>& sample) {
  constexpr double kMost = 1.4, kMoreByMip = 1.4;  // of the top's bytes .35, .12 and .04
  for (std::size_t p = 0; p < sample.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (plane.mip == 0 || !sample[plane.base].source_rung) continue;
    double most = kMost * bytes_per_texel(fragments.planes[plane.base], sample[plane.base].rungs.back());
    for (std::uint32_t m = 1; m < plane.mip; ++m) most *= kMoreByMip;
    std::vector<LadderRung>& of_mip = sample[p].rungs;
    while (of_mip.size() > 1 && bytes_per_texel(plane, of_mip.back()) > most) of_mip.pop_back();
  }
}

bool holds_all(const TexturePlane& plane, const PlaneLadder& ladder) {
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (plane.covered_texels[f] > 0 && fragment_stream(ladder.rungs[0], f).empty()) return false;
  return true;
}

/// All covered fragments at the rungs that are kept. What the sample holds of them is not encoded again.
std::vector<PlaneWork> whole_work(const Fragments& fragments, std::vector<PlaneLadder> sample,
                                  std::vector<std::vector<std::size_t>> kept) {
  std::vector<PlaneWork> work(sample.size());
  for (std::size_t p = 0; p < work.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (!holds_all(plane, sample[p])) work[p].wanted.assign(plane.fragment_count(), 1);
    for (const std::size_t r : kept[p]) work[p].known.push_back(std::move(sample[p].rungs[r]));
    work[p].rungs = std::move(kept[p]);
  }
  return work;
}

std::string hundredths(double x) {
  const auto whole = static_cast<std::uint64_t>(x * 100 + 0.5);
  const std::string rest = std::to_string(whole % 100);
  return std::to_string(whole / 100) + "." + (rest.size() < 2 ? "0" : "") + rest;
}

/// What a plane's ladder says of its source.
void finish_plane(const TexturePlane& plane, const Pixels& pixels, const std::vector<Image>& images,
                  const TrainedPlane& trained, const LadderOptions& options, PlaneLadder& ladder,
                  Notes& notes) {
  if (plane.mip > 0 || plane.role == TextureRole::kAlpha || images.empty()) return;
  const Image& image = images[plane.image];
  if (!trained.source.why_not.empty())
    add_info(notes, "jpeg-coded-anew", image.name,
             "it is coded from its pixels, since " + trained.source.why_not + "; the last rung is " +
                 hundredths(source_difference(plane, pixels, ladder)) + " of 255 off on average");
  if (!options.keep_source) return;
  const bool changed =
      changes_colours(image, is_colour(plane.role) ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
  ladder.source = changed ? SourceFile::kOtherColours : SourceFile::kSameColours;
}

}  // namespace

const std::vector<int>& ladder_rungs(TextureRole role, const LadderOptions& options) {
  if (is_colour(role)) return options.rungs;
  if (role == TextureRole::kNormal) return options.normal_rungs;
  return role == TextureRole::kAlpha ? options.alpha_rungs : options.data_rungs;
}

Ladder encode_ladder(const Fragments& fragments, const std::vector<Pixels>& pixels, const Previews& previews,
                     const std::vector<Image>& images, const LadderOptions& options,
                     const RunContext& context) {
  check(fragments, pixels, previews, images, options);
  Ladder ladder;
  std::vector<TrainedPlane> trained = train_planes(fragments, pixels, images, options, ladder.notes, context);
  const auto encode = [&](std::vector<PlaneWork> work, ProgressPart progress) {
    return encode_rungs(fragments, pixels, options.uncovered, trained, std::move(work), progress, context);
  };
  std::vector<PlaneLadder> sample =
      encode(sample_work(fragments, trained, options.prune), {kTrained, kSampled});
  auto kept = all_rungs(trained);
  if (options.prune) {
    leave_heavy_mips_out(fragments, sample);
    kept = choose_rungs(fragments, pixels, sample, previews, context);
  }
  measure_knots(fragments, pixels, options, kept, trained, context);
  ladder.planes = encode(whole_work(fragments, std::move(sample), std::move(kept)), {kChosen, 1});
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    finish_plane(fragments.planes[p], pixels[p], images, trained[p], options, ladder.planes[p], ladder.notes);
  return ladder;
}

}  // namespace texmesh
