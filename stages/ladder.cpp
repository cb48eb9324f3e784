#include "stages/ladder.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <string>

#include "stages/jpeg_coder.h"
#include "stages/parallel.h"

namespace texmesh {
namespace {

// Rungs are packed by at most this many per model in tables.bin, and more than that buys nothing (16
// rungs gain 0.1 dB over 10).
constexpr std::size_t kMaxRungs = 16;
constexpr std::size_t kFragmentsPerTask = 4;
constexpr std::size_t kPreviewLimitBytes = 16 * 1024;
// Share of the trained statistics against the typical tables' in a rung's tables: costs < 0.2 % where the
// training fits, and bounds what a fragment unlike the others costs.
constexpr std::uint64_t kTrainedWeight = 256;

void check(const Fragments& fragments, const std::vector<Pixels>& pixels, const LadderOptions& options) {
  const auto fail = [](std::string place, std::string expected, std::string found) {
    throw StageError("ladder", std::move(place), std::move(expected), std::move(found));
  };
  if (options.rungs.empty() || options.rungs.size() > kMaxRungs)
    fail("rungs", "1.." + std::to_string(kMaxRungs) + " qualities", std::to_string(options.rungs.size()));
  for (std::size_t r = 0; r < options.rungs.size(); ++r) {
    const int quality = options.rungs[r];
    if (quality < 1 || quality > 100) fail("rungs", "1..100", std::to_string(quality));
    if (r > 0 && quality <= options.rungs[r - 1])
      fail("rungs", "more than " + std::to_string(options.rungs[r - 1]), std::to_string(quality));
  }
  if (pixels.size() != fragments.planes.size())
    fail("pixels", std::to_string(fragments.planes.size()) + " planes", std::to_string(pixels.size()));
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const std::uint64_t width = std::uint64_t{plane.columns} * plane.fragment_width_px;
    const std::uint64_t height = std::uint64_t{plane.rows} * plane.fragment_height_px;
    if (pixels[p].width_px != width || pixels[p].height_px != height ||
        pixels[p].channels != plane.channels || pixels[p].data.size() != width * height * plane.channels ||
        plane.covered_texels.size() != plane.fragment_count())
      fail("plane " + std::to_string(p), std::to_string(width) + " x " + std::to_string(height),
           std::to_string(pixels[p].width_px) + " x " + std::to_string(pixels[p].height_px));
  }
}

PixelWindow window_of(const TexturePlane& plane, const Pixels& pixels, std::size_t fragment) {
  const auto column = static_cast<std::uint32_t>(fragment % plane.columns);
  const auto row = static_cast<std::uint32_t>(fragment / plane.columns);
  return {pixels.at(column * plane.fragment_width_px, row * plane.fragment_height_px),
          std::size_t{pixels.width_px} * pixels.channels, plane.fragment_width_px, plane.fragment_height_px};
}

Subsampling subsampling_of(const TexturePlane& plane, const LadderOptions& options) {
  return is_colour(plane.role) ? options.subsampling : Subsampling::k444;
}

/// Fragments that the tables are trained on: covered ones, evenly spread in index order.
std::vector<std::size_t> training_fragments(const TexturePlane& plane, int wanted) {
  std::vector<std::size_t> covered;
  for (std::size_t f = 0; f < plane.covered_texels.size(); ++f)
    if (plane.covered_texels[f] > 0) covered.push_back(f);
  const std::size_t count = std::min(covered.size(), static_cast<std::size_t>(std::max(wanted, 1)));
  std::vector<std::size_t> chosen(count);
  for (std::size_t k = 0; k < count; ++k) chosen[k] = covered[(2 * k + 1) * covered.size() / (2 * count)];
  return chosen;
}

/// The middles of the training fragments side by side: about 1/16 of the plane, because coding the mosaic
/// with optimised tables costs three times as much per pixel as the ladder itself; at least 256 x 256 where
/// there is so much.
Pixels training_mosaic(const TexturePlane& plane, const Pixels& pixels, const LadderOptions& options) {
  const std::vector<std::size_t> chosen = training_fragments(plane, options.training_fragments);
  if (chosen.empty()) return {};
  const std::uint64_t budget =
      std::max<std::uint64_t>(std::uint64_t{pixels.width_px} * pixels.height_px / 16, 65536);
  std::uint32_t side = 16;
  while (std::uint64_t{side + 16} * (side + 16) * chosen.size() <= budget) side += 16;
  const std::uint32_t w = std::min(side, plane.fragment_width_px),
                      h = std::min(side, plane.fragment_height_px);
  std::uint32_t across = 1;
  while (std::size_t{across} * across < chosen.size()) ++across;
  const auto down = static_cast<std::uint32_t>((chosen.size() + across - 1) / across);
  Pixels mosaic{across * w, down * h, plane.channels, {}};
  const std::size_t stride = std::size_t{mosaic.width_px} * mosaic.channels;
  mosaic.data.resize(stride * mosaic.height_px);
  for (std::size_t k = 0; k < std::size_t{across} * down; ++k) {
    const PixelWindow from = window_of(plane, pixels, chosen[k % chosen.size()]);
    const std::size_t left = (from.width_px - w) / 2 * plane.channels, top = (from.height_px - h) / 2;
    std::uint8_t* to = mosaic.data.data() + k / across * h * stride + k % across * w * plane.channels;
    for (std::uint32_t y = 0; y < h; ++y)
      std::memcpy(to + y * stride, from.data + (top + y) * from.stride_bytes + left,
                  std::size_t{w} * plane.channels);
  }
  return mosaic;
}

/// A table like `trained`, with a code for every symbol of `typical`. Weights are read off code lengths: a
/// code of length l stands for a probability of 2^-l.
HuffmanTable completed(const HuffmanTable& trained, const HuffmanTable& typical) {
  std::array<std::uint64_t, 256> weight{};
  const auto add = [&weight](const HuffmanTable& table, std::uint64_t scale) {
    std::size_t at = 0;
    for (std::size_t l = 1; l <= 16; ++l)
      for (int k = 0; k < table.bits[l]; ++k) weight[table.symbols[at++]] += scale << (16 - l);
  };
  add(trained, kTrainedWeight);
  add(typical, 1);
  std::vector<std::uint64_t> weights;
  for (std::uint8_t symbol : typical.symbols) weights.push_back(weight[symbol]);
  return make_huffman_table(typical.symbols, weights);
}

HuffmanTables train_tables(const Pixels& mosaic, JpegCoder& coder) {
  const HuffmanTables typical = coder.tables();
  if (mosaic.data.empty()) return typical;
  HuffmanTables tables = coder.train({mosaic.data.data(), std::size_t{mosaic.width_px} * mosaic.channels,
                                      mosaic.width_px, mosaic.height_px});
  for (std::size_t k = 0; k < tables.size(); ++k) tables[k] = completed(tables[k], typical[k]);
  return tables;
}

/// Sums over boxes of a plane proper (not its padding); boxes at the right and bottom may be partial.
struct BoxSums {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<std::uint32_t> sum, count;  // [box * channels + channel], [box]
};

BoxSums sums_of_eight(const Pixels& from, std::uint32_t width, std::uint32_t height) {
  BoxSums out{(width + 7) / 8, (height + 7) / 8, from.channels, {}, {}};
  out.count.resize(std::size_t{out.width} * out.height);
  out.sum.resize(out.count.size() * out.channels);
  for (std::uint32_t y = 0; y < height; ++y) {
    const std::uint8_t* p = from.at(0, y);
    std::uint32_t* sum = out.sum.data() + std::size_t{y / 8} * out.width * out.channels;
    std::uint32_t* count = out.count.data() + std::size_t{y / 8} * out.width;
    for (std::uint32_t x = 0; x < width; x += 8, sum += out.channels) {
      const std::uint32_t n = std::min(8u, width - x);
      *count++ += n;
      if (out.channels == 3) {
        for (std::uint32_t k = 0; k < n; ++k, p += 3) sum[0] += p[0], sum[1] += p[1], sum[2] += p[2];
      } else {
        for (std::uint32_t k = 0; k < n; ++k) sum[0] += *p++;
      }
    }
  }
  return out;
}

BoxSums sums_of_twice(const BoxSums& from) {
  BoxSums out{(from.width + 1) / 2, (from.height + 1) / 2, from.channels, {}, {}};
  out.count.resize(std::size_t{out.width} * out.height);
  out.sum.resize(out.count.size() * out.channels);
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) {
      const std::size_t a = std::size_t{y} * from.width + x, b = std::size_t{y / 2} * out.width + x / 2;
      out.count[b] += from.count[a];
      for (std::uint32_t c = 0; c < out.channels; ++c)
        out.sum[b * out.channels + c] += from.sum[a * out.channels + c];
    }
  return out;
}

Pixels means_of(const BoxSums& boxes) {
  Pixels out{boxes.width, boxes.height, boxes.channels, {}};
  out.data.resize(boxes.sum.size());
  for (std::size_t k = 0; k < out.data.size(); ++k) {
    const std::uint32_t count = boxes.count[k / boxes.channels];
    out.data[k] = static_cast<std::uint8_t>((boxes.sum[k] + count / 2) / count);
  }
  return out;
}

void encode_preview(const TexturePlane& plane, const Pixels& pixels, const LadderOptions& options,
                    PlaneLadder& out) {
  const auto encode = [&](const BoxSums& boxes) {
    out.preview = encode_jpeg(means_of(boxes), options.preview_quality, subsampling_of(plane, options));
    out.preview_width_px = boxes.width;
    out.preview_height_px = boxes.height;
  };
  const BoxSums eighth = sums_of_eight(pixels, plane.width_px, plane.height_px);
  encode(eighth);
  if (out.preview.size() >= kPreviewLimitBytes) encode(sums_of_twice(eighth));
}

/// A few neighbouring fragments at every rung: what one thread encodes at a time. Fragment by fragment, so
/// that the pixels of one stay in the cache for all its rungs; rung by rung costs a quarter more.
struct EncodeTask {
  std::size_t plane, first, last;
  std::vector<std::vector<std::uint8_t>> data;  // [rung]: streams one after the other
  std::vector<std::vector<std::size_t>> sizes;  // [rung][fragment - first]
};

std::vector<EncodeTask> encode_tasks(const Fragments& fragments) {
  std::vector<EncodeTask> tasks;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    for (std::size_t f = 0; f < fragments.planes[p].fragment_count(); f += kFragmentsPerTask)
      tasks.push_back({p, f, std::min(f + kFragmentsPerTask, fragments.planes[p].fragment_count()), {}, {}});
  return tasks;
}

void encode_fragments(const TexturePlane& plane, const Pixels& pixels, const HuffmanTables* tables,
                      const LadderOptions& options, EncodeTask& task) {
  const std::size_t rungs = options.rungs.size();
  std::vector<std::unique_ptr<JpegCoder>> coders;
  for (std::size_t r = 0; r < rungs; ++r) {
    coders.push_back(
        std::make_unique<JpegCoder>(plane.channels, options.rungs[r], subsampling_of(plane, options)));
    coders[r]->use_tables(tables[r]);
  }
  task.data.resize(rungs);
  task.sizes.assign(rungs, std::vector<std::size_t>(task.last - task.first));
  for (std::size_t f = task.first; f < task.last; ++f) {
    if (plane.covered_texels[f] == 0) continue;
    for (std::size_t r = 0; r < rungs; ++r) {
      const std::vector<std::uint8_t> stream = coders[r]->abbreviated(window_of(plane, pixels, f));
      task.sizes[r][f - task.first] = stream.size();
      task.data[r].insert(task.data[r].end(), stream.begin(), stream.end());
    }
  }
}

void append(EncodeTask& task, PlaneLadder& plane) {
  for (std::size_t r = 0; r < plane.rungs.size(); ++r) {
    LadderRung& rung = plane.rungs[r];
    if (rung.offset.empty()) rung.offset.push_back(0);
    for (std::size_t size : task.sizes[r]) rung.offset.push_back(rung.offset.back() + size);
    rung.data.insert(rung.data.end(), task.data[r].begin(), task.data[r].end());
  }
  task.data.clear();
}

}  // namespace

Ladder encode_ladder(const Fragments& fragments, const std::vector<Pixels>& pixels,
                     const LadderOptions& options, const RunContext& context) {
  check(fragments, pixels, options);
  const std::size_t planes = fragments.planes.size(), rungs = options.rungs.size();
  Ladder ladder;
  ladder.planes.resize(planes);
  std::vector<Pixels> mosaic(planes);
  parallel_for(context, planes, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      ladder.planes[p].rungs.resize(rungs);
      mosaic[p] = training_mosaic(fragments.planes[p], pixels[p], options);
      encode_preview(fragments.planes[p], pixels[p], options, ladder.planes[p]);
    }
  });
  context.report(0.05);

  std::vector<HuffmanTables> tables(planes * rungs);
  parallel_for(context, planes * rungs, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const TexturePlane& plane = fragments.planes[k / rungs];
      LadderRung& rung = ladder.planes[k / rungs].rungs[k % rungs];
      rung.quality = options.rungs[k % rungs];
      JpegCoder coder(plane.channels, rung.quality, subsampling_of(plane, options));
      tables[k] = train_tables(mosaic[k / rungs], coder);
      coder.use_tables(tables[k]);
      rung.tables = coder.table_stream();
    }
  });
  context.report(0.2);

  std::vector<EncodeTask> tasks = encode_tasks(fragments);
  std::atomic<std::size_t> done{0};
  parallel_for(context, tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const std::size_t p = tasks[t].plane;
      encode_fragments(fragments.planes[p], pixels[p], tables.data() + p * rungs, options, tasks[t]);
      context.report(0.2 + 0.8 * static_cast<double>(++done) / static_cast<double>(tasks.size()));
    }
  });
  for (EncodeTask& task : tasks) append(task, ladder.planes[task.plane]);
  return ladder;
}

std::span<const std::uint8_t> fragment_stream(const LadderRung& rung, std::size_t fragment) {
  return std::span(rung.data).subspan(rung.offset[fragment],
                                      rung.offset[fragment + 1] - rung.offset[fragment]);
}

}  // namespace texmesh
