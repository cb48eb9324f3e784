#include "lab/study/fragment_study.h"

#include <limits>

#include "stages/base/parallel.h"
#include "stages/data/fragments.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/ladder/ladder.h"

namespace texmesh {

TexturePlane covered_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t fragment_width_px,
                           std::uint32_t fragment_height_px) {
  TexturePlane plane;
  plane.columns = columns, plane.rows = rows;
  plane.fragment_width_px = fragment_width_px, plane.fragment_height_px = fragment_height_px;
  plane.width_px = columns * fragment_width_px, plane.height_px = rows * fragment_height_px;
  plane.coverage.assign(coverage_size_bytes(plane.width_px, plane.height_px), 0xff);
  const std::size_t count = plane.fragment_count();
  plane.covered_texels.assign(count, fragment_width_px * fragment_height_px);
  plane.surface_fraction.assign(count, 1.0f / static_cast<float>(count));
  plane.features.assign(count, 0);
  plane.eta.assign(count, 0);
  return plane;
}

namespace {

constexpr std::uint64_t kJfifHeader = 18, kMarkersInCommon = 4;  // SOI and EOI stand in both streams
constexpr std::uint32_t kBlock = 16;

[[noreturn]] void fail(std::string place, std::string expected, std::string found) {
  throw StageError("fragment study", std::move(place), std::move(expected), std::move(found));
}

void check(const Pixels& pixels, const FragmentStudyOptions& options) {
  if ((pixels.channels != 1 && pixels.channels != 3) || pixels.width_px == 0 || pixels.height_px == 0 ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    fail("pixels", "1 or 3 channels", std::to_string(pixels.channels));
  if (options.grids.empty() || options.qualities.empty() || options.qualities.size() > 16)
    fail("options", "grids, and 1 to 16 qualities", std::to_string(options.qualities.size()));
  for (const int n : options.grids)
    if (n < 1 || n > 64) fail("grids", "1 to 64", std::to_string(n));
  for (std::size_t k = 0; k < options.qualities.size(); ++k)
    if (options.qualities[k] < 1 || options.qualities[k] > 100 ||
        (k > 0 && options.qualities[k] <= options.qualities[k - 1]))
      fail("qualities", "1 to 100, strictly rising", std::to_string(options.qualities[k]));
}

/// The image and how it is cut: whole fragments, edges repeated.
struct CutImage {
  Fragments fragments;  // one plane, covered everywhere
  std::vector<Pixels> pixels;
};

CutImage cut_image(const Pixels& pixels, std::uint32_t grid) {
  const auto side = [&](std::uint32_t size) { return (size + grid * kBlock - 1) / (grid * kBlock) * kBlock; };
  const auto count = [](std::uint32_t size, std::uint32_t of) { return (size + of - 1) / of; };
  const std::uint32_t width_px = side(pixels.width_px), height_px = side(pixels.height_px);
  TexturePlane plane = covered_plane(count(pixels.width_px, width_px), count(pixels.height_px, height_px),
                                     width_px, height_px);
  plane.channels = pixels.channels;
  Pixels whole{plane.width_px, plane.height_px, pixels.channels, {}};
  const std::size_t stride = std::size_t{whole.width_px} * whole.channels,
                    used = std::size_t{pixels.width_px} * pixels.channels;
  whole.data.resize(stride * whole.height_px);
  for (std::uint32_t y = 0; y < whole.height_px; ++y) {
    std::uint8_t* row = whole.data.data() + stride * y;
    std::memcpy(row, pixels.at(0, std::min(y, pixels.height_px - 1)), used);
    for (std::size_t k = used; k < stride; ++k) row[k] = row[k - whole.channels];
  }
  CutImage out;
  out.fragments.planes.push_back(std::move(plane));
  out.pixels.push_back(std::move(whole));
  return out;
}

PixelWindow window_of(const Pixels& pixels, const TexelRectangle& r) {
  return {pixels.at(r.left_px, r.top_px), std::size_t{pixels.width_px} * pixels.channels, r.width_px,
          r.height_px};
}

struct FileSizes {
  std::uint64_t standard = 0, optimised = 0;
};

/// The kind that the rungs have, so that a file and its fragments differ in nothing but the cuts.
JpegKind file_kind(const Pixels& pixels, int quality, const FragmentStudyOptions& options) {
  PlaneCoding coding;
  coding.channels = pixels.channels;
  coding.subsampling = options.subsampling;
  return baseline_kind(coding, quality);
}

FileSizes file_sizes(const Pixels& pixels, const PixelWindow& window, int quality,
                     const FragmentStudyOptions& options) {
  const JpegKind kind = file_kind(pixels, quality, options);
  JpegCoder standard(kind);
  std::vector<std::uint8_t> body;
  standard.append_body(window, body);
  return {standard.head_stream(window.width_px, window.height_px).size() + body.size() - kMarkersInCommon +
              (kind.rgb ? 0 : kJfifHeader),  // the head names its channels
          options.optimised ? JpegCoder(kind).complete(window).size() : 0};
}

/// What decoding takes: the least of a few times, since caches are cold at first and other programs disturb.
template <class Decode>
double decode_s(const std::function<double()>& clock_s, const Decode& decode) {
  constexpr int kTimes = 3;
  double least_s = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kTimes; ++k) {
    const double start_s = clock_s();
    decode();
    least_s = std::min(least_s, clock_s() - start_s);
  }
  return least_s;
}

double file_decode_s(const Pixels& pixels, int quality, const FragmentStudyOptions& options) {
  JpegCoder coder(file_kind(pixels, quality, options));
  const std::vector<std::uint8_t> file =
      coder.complete(window_of(pixels, {0, 0, pixels.width_px, pixels.height_px}));
  return decode_s(options.clock_s, [&] { decode_jpeg(file, pixels.data.size()); });
}

double fragments_decode_s(const PlaneLadder& ladder, std::size_t rung, const TexturePlane& plane,
                          const FragmentStudyOptions& options) {
  const std::uint64_t texels = std::uint64_t{plane.fragment_width_px} * plane.fragment_height_px;
  return decode_s(options.clock_s, [&] {
    for (std::size_t f = 0; f < plane.fragment_count(); ++f) decode_fragment(ladder, rung, f, texels);
  });
}

/// Rows of one grid. `whole`: sizes of the image in one file, by quality.
std::vector<FragmentStudyRow> study_grid(const Pixels& image, int grid, const std::vector<FileSizes>& whole,
                                         const FragmentStudyOptions& options, const RunContext& context) {
  const CutImage cut = cut_image(image, static_cast<std::uint32_t>(grid));
  const TexturePlane& plane = cut.fragments.planes[0];
  LadderOptions ladder_options;
  ladder_options.rungs = options.qualities;
  ladder_options.prune = false;
  ladder_options.subsampling = options.subsampling;
  RunContext quiet = context;
  quiet.progress = nullptr;
  const Ladder ladder = encode_ladder(cut.fragments, cut.pixels, {}, {}, ladder_options, quiet);
  const std::size_t count = plane.fragment_count(), qualities = options.qualities.size();
  std::vector<FileSizes> files(count * qualities);
  parallel_each(context, files.size(), 1, [&](std::size_t k) {
    const PixelWindow window = window_of(cut.pixels[0], padded_fragment_rectangle(plane, k % count));
    files[k] = file_sizes(cut.pixels[0], window, options.qualities[k / count], options);
  });
  std::vector<FragmentStudyRow> rows;
  for (std::size_t q = 0; q < qualities; ++q) {
    FragmentStudyRow row;
    row.grid = grid, row.quality = options.qualities[q];
    row.columns = plane.columns, row.rows = plane.rows;
    row.fragment_width_px = plane.fragment_width_px, row.fragment_height_px = plane.fragment_height_px;
    row.file_standard = whole[q].standard, row.file_optimised = whole[q].optimised;
    for (std::size_t f = 0; f < count; ++f) {
      row.sum_standard += files[q * count + f].standard;
      row.sum_optimised += files[q * count + f].optimised;
    }
    const LadderRung& rung = ladder.planes[0].rungs[q];
    row.sum_shared = rung.data.size() + rung.table_stream.size();
    if (options.clock_s) {
      row.file_decode_s = file_decode_s(image, options.qualities[q], options);
      row.fragments_decode_s = fragments_decode_s(ladder.planes[0], q, plane, options);
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

std::vector<FragmentStudyRow> study_fragments(const Pixels& pixels, const FragmentStudyOptions& options,
                                              const RunContext& context) {
  check(pixels, options);
  std::vector<FileSizes> whole(options.qualities.size());
  parallel_each(context, whole.size(), 1, [&](std::size_t q) {
    whole[q] = file_sizes(pixels, window_of(pixels, {0, 0, pixels.width_px, pixels.height_px}),
                          options.qualities[q], options);
  });
  std::vector<FragmentStudyRow> out;
  for (std::size_t g = 0; g < options.grids.size(); ++g) {
    const auto before = options.grids.begin() + static_cast<std::ptrdiff_t>(g);
    if (std::find(options.grids.begin(), before, *before) != before) continue;
    const auto rows = study_grid(pixels, options.grids[g], whole, options, context);
    out.insert(out.end(), rows.begin(), rows.end());
    context.report(static_cast<double>(g + 1) / static_cast<double>(options.grids.size()));
  }
  return out;
}

}  // namespace texmesh
