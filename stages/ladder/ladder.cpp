#include <numeric>

#include "format/rules/size_curve.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/masked_jpeg.h"
#include "stages/ladder/choose_rungs.h"
#include "stages/ladder/encode_rungs.h"

namespace texmesh {
namespace {

/// Knots between the rungs of a plane, from what a sample takes at every whole quality, `bits` [0..100]; none
/// for empty `bits`.
SizeKnots size_knots(const std::vector<int>& rungs, const std::vector<double>& bits) {
  SizeKnots out;
  if (bits.empty() || rungs.size() < 2) return out;
  std::vector<std::uint8_t> rung_quality;
  std::vector<double> rung_bits, knot_bits;
  for (int q = rungs.front(); q <= rungs.back(); ++q) {
    const bool rung = q == rungs[rung_quality.size()];
    (rung ? rung_quality : out.quality).push_back(static_cast<std::uint8_t>(q));
    (rung ? rung_bits : knot_bits).push_back(bits[static_cast<std::size_t>(q)]);
  }
  out.position = knot_positions(rung_quality, rung_bits, out.quality, knot_bits);
  return out;
}

/// Measures how the bytes of a plane of colours grow between the rungs of its baseline JPEGs: what `sample`
/// takes at `plane.qualities` and at every whole quality between them (jpeg_bits()). What bends sizes there
/// most are the quantisers of the JPEG that the texture has been before, and these are the same everywhere in
/// a plane, so that a small sample tells it for all fragments. None for an empty sample and for fewer than
/// two qualities. Same result for any thread count.
SizeKnots measure_size_knots(const PlaneCoding& plane, std::span<const PixelWindow> sample,
                             const RunContext& context) {
  if (sample.empty() || plane.qualities.size() < 2) return {};
  std::vector<int> qualities;
  for (int q = plane.qualities.front(); q <= plane.qualities.back(); ++q) qualities.push_back(q);
  JpegKind kind;
  kind.channels = plane.channels;
  kind.subsampling = plane.subsampling;
  std::vector<double> bits(101);
  std::ranges::copy(jpeg_bits(kind, sample, qualities, context), bits.begin() + qualities.front());
  if (qualities.back() == kFinestQuality && plane.channels == 3) {
    kind.rgb = true;
    bits.back() = jpeg_bits(kind, sample, std::span(&kFinestQuality, 1), context).front();
  }
  return size_knots(plane.qualities, bits);
}

/// Mean absolute difference of 8-bit samples between the plane's last rung and `pixels`, over the covered
/// texels of up to 16 stored fragments, evenly spread in index order; 0 when nothing is stored.
double source_difference(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder) {
  constexpr std::size_t kMostFragments = 16;
  const std::size_t top = ladder.rungs.size() - 1;
  std::vector<std::size_t> stored;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (!fragment_stream(ladder.rungs[top], f).empty()) stored.push_back(f);
  const std::size_t count = std::min(stored.size(), kMostFragments);
  std::uint64_t sum = 0, samples = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t f = stored[k * stored.size() / count];
    const TexelRectangle padded = padded_fragment_rectangle(plane, f), at = fragment_rectangle(plane, f);
    const Pixels decoded = decode_fragment(ladder, top, f, std::uint64_t{padded.width_px} * padded.height_px);
    for (std::uint32_t y = 0; y < at.height_px; ++y)
      for (std::uint32_t x = 0; x < at.width_px; ++x) {
        if (!plane.coverage.empty() && !CoverageMask(plane).covered(at.left_px + x, at.top_px + y)) continue;
        const std::uint8_t* from = pixels.at(at.left_px + x, at.top_px + y);
        for (std::uint32_t c = 0; c < pixels.channels; ++c)
          sum += static_cast<std::uint64_t>(std::abs(int{from[c]} - int{decoded.at(x, y)[c]}));
        samples += pixels.channels;
      }
  }
  return samples > 0 ? static_cast<double>(sum) / static_cast<double>(samples) : 0;
}

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

/// Whether all images are JPEGs that take few bytes together. Then no rung below a colour's own is worth
/// storing, and of its mips one of the highest, where the source is of quality 30 and more: of 28 models with
/// images of 256 and 512 px. What is not tried is a third of the stage's time. Mips of normals of quality 70
/// need lower ones.
bool are_few_bytes(const std::vector<Image>& images) {
  constexpr std::size_t kFewBytes = 150'000;
  std::size_t bytes = 0;
  for (const Image& image : images) {
    if (image.format != ImageFormat::kJpeg) return false;
    bytes += image.bytes.size();
  }
  return !images.empty() && bytes <= kFewBytes;
}

void keep_highest(std::vector<int>& qualities) {
  constexpr std::size_t kHighest = 3;
  if (qualities.size() > kHighest) qualities.erase(qualities.begin(), qualities.end() - kHighest);
}

PlaneCoding coding_of(const TexturePlane& plane, Codec codec, const LadderOptions& options) {
  PlaneCoding coding;
  coding.channels = plane.channels;
  coding.fragment_width_px = plane.fragment_width_px;
  coding.fragment_height_px = plane.fragment_height_px;
  // A mip's texels have the chroma of several of the source's. With it halved, a mip of a turtle takes twice
  // the bytes for the same FLIP.
  coding.subsampling = is_colour(plane.role) && (plane.mip == 0 || codec != Codec::kJpeg)
                           ? options.subsampling
                           : Subsampling::k444;
  coding.qualities = ladder_rungs(plane.role, options);
  if (codec == Codec::kJpegProgressive && is_colour(plane.role))
    coding.qualities = {options.progressive_quality};
  return coding;
}

/// Adds the rung that stands for a source without loss.
void add_finest(const TexturePlane& plane, const std::vector<Image>& images, const LadderOptions& options,
                PlaneCoding& coding) {
  if (options.prune && options.mode == LadderMode::kJpeg && plane.mip == 0 && !images.empty() &&
      is_lossless(images[plane.image]) && coding.qualities.back() < kFinestQuality)
    coding.qualities.push_back(kFinestQuality);
}

/// The space of three channels of data, by what a sample of their pixels shows. Mips have their full size's
/// (`base`, or null where the source's coefficients have one): measuring each took a tenth of the stage's
/// time.
void choose_space(const TexturePlane& plane, const Pixels& pixels, Codec codec, Uncovered uncovered,
                  const PlaneCoding* base, TrainedPlane& trained, const RunContext& context) {
  if (is_colour(plane.role) || plane.channels != 3) return;
  PlaneCoding& coding = trained.coding;
  const CodingSpace space =
      base
          ? CodingSpace{base->apart, base->subsampling, base->coarse_last, base->without_z}
          : measure_coding_space(plane.role == TextureRole::kNormal ? DataKind::kVectors : DataKind::kNumbers,
                                 codec != Codec::kJpeg, size_sample(plane, pixels, uncovered), context);
  coding.apart = space.apart;
  coding.subsampling = space.subsampling;
  coding.coarse_last = space.coarse_last;
  coding.without_z = space.without_z;
  if (space.without_z)
    trained.made = without_z(
        {pixels.data.data(), std::size_t{3} * pixels.width_px, pixels.width_px, pixels.height_px, {}});
}

/// The codecs of all planes, trained on samples of their pixels.
std::vector<TrainedPlane> train_planes(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                       const std::vector<Image>& images, const LadderOptions& options,
                                       Notes& notes, const RunContext& context) {
  std::vector<TrainedPlane> out;
  const bool few_bytes = options.prune && options.mode == LadderMode::kJpeg && are_few_bytes(images);
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const Codec codec = codec_of(plane, p, options.mode, notes);
    const bool few = few_bytes && is_colour(plane.role);
    TrainedPlane& trained = out.emplace_back();
    trained.coding = coding_of(plane, codec, options);
    if (codec == Codec::kJpeg && options.mode == LadderMode::kJpeg && !images.empty())
      trained.source = make_source_codec(plane, pixels[p], images[plane.image], options, few, context);
    if (trained.source.codec) {
      trained.codec = std::move(trained.source.codec);
      trained.source_rung = true;
    } else {
      const TrainedPlane* base = plane.mip > 0 ? &out[plane.base] : nullptr;
      const bool known = base && !base->source_rung && base->codec->id() != Codec::kJpegProgressive;
      choose_space(plane, pixels[p], codec, options.uncovered, known ? &base->coding : nullptr, trained,
                   context);
      add_finest(plane, images, options, trained.coding);
      constexpr int kFineSource = 30;
      if (few && base && base->source_rung && base->rungs.back().quality >= kFineSource)
        keep_highest(trained.coding.qualities);
      trained.codec = make_texture_codec(codec, trained.coding);
    }
    trained.rungs = trained.codec->train(
        training_sample(plane, trained.coded(pixels[p]), options.uncovered, options.training_fragments),
        context);
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

/// Knots of full-size colours, between the rungs that are stored.
void measure_knots(const Fragments& fragments, const std::vector<Pixels>& pixels,
                   const LadderOptions& options, const std::vector<TrainedPlane>& trained,
                   std::vector<PlaneLadder>& planes, const RunContext& context) {
  for (std::size_t p = 0; p < planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (planes[p].codec != Codec::kJpeg || !is_colour(plane.role) || plane.mip > 0) continue;
    PlaneCoding coding = trained[p].coding;
    coding.qualities.clear();
    for (const LadderRung& rung : planes[p].rungs) coding.qualities.push_back(rung.quality);
    planes[p].knots =
        planes[p].source_rung
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

/// Whether all rungs of some texture take more than they may.
bool take_too_much(const Fragments& fragments, const std::vector<PlaneLadder>& planes,
                   const std::vector<Image>& images) {
  std::vector<double> bytes(planes.size());
  for (std::size_t p = 0; p < planes.size(); ++p)
    for (const LadderRung& rung : planes[p].rungs)
      bytes[fragments.planes[p].mip > 0 ? fragments.planes[p].base : p] +=
          static_cast<double>(rung.data.size() + rung.table_stream.size());
  for (std::size_t p = 0; p < planes.size(); ++p)
    if (bytes[p] > 0 && bytes[p] > most_bytes(fragments.planes[p], images)) return true;
  return false;
}

/// Leaves only the rungs of these indices.
void keep_rungs(const std::vector<std::vector<std::size_t>>& kept, std::vector<PlaneLadder>& planes) {
  for (std::size_t p = 0; p < planes.size(); ++p) {
    std::vector<LadderRung> rungs;
    for (const std::size_t r : kept[p]) rungs.push_back(std::move(planes[p].rungs[r]));
    planes[p].rungs = std::move(rungs);
  }
}

std::string hundredths(double x) {
  const auto whole = static_cast<std::uint64_t>(x * 100 + 0.5);
  const std::string rest = std::to_string(whole % 100);
  return std::to_string(whole / 100) + "." + (rest.size() < 2 ? "0" : "") + rest;
}

/// What is wrong with a JPEG that was decoded nevertheless. One whose coefficients were read is sound.
std::string damage_of(const Image& image, const TrainedPlane& trained) {
  std::string damage;
  if (image.format == ImageFormat::kJpeg && image.bits_per_channel == 8 && !trained.source_rung)
    decode_image(image, FloatEncoding::kAsIs, &damage);
  return damage;
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
  const std::string damage = damage_of(image, trained);
  if (!damage.empty())
    add_warning(notes, "damaged-image", image.name,
                damage_words(damage) + (options.keep_source ? "; its file is not kept" : ""));
  if (!options.keep_source || !damage.empty()) return;
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
  if (options.prune) kept = choose_rungs(fragments, pixels, sample, previews, images, context);
  ladder.planes = encode(whole_work(fragments, std::move(sample), std::move(kept)), {kChosen, 1});
  // What a sample lets expect of a texture's bytes is some hundredths off.
  if (options.prune && take_too_much(fragments, ladder.planes, images))
    keep_rungs(choose_rungs(fragments, pixels, ladder.planes, previews, images, context), ladder.planes);
  measure_knots(fragments, pixels, options, trained, ladder.planes, context);
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    finish_plane(fragments.planes[p], pixels[p], images, trained[p], options, ladder.planes[p], ladder.notes);
  return ladder;
}

}  // namespace texmesh
