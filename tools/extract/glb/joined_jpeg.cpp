#include "tools/extract/glb/joined_jpeg.h"

#include <algorithm>
#include <string>
#include <utility>

#include "delivery/cpp/package/plane_streams.h"
#include "format/base/errors.h"
#include "stages/base/parallel.h"
#include "stages/data/coverage.h"
#include "stages/image/decode_jpeg.h"
#include "tools/extract/glb/jpeg_writer.h"

namespace texmesh {
namespace {

std::uint32_t divided_up(std::uint64_t a, std::uint64_t b) {
  return static_cast<std::uint32_t>((a + b - 1) / b);
}

/// What a JPEG of coefficients is made of; refers to everything.
struct CoefficientFile {
  std::uint32_t width_px, height_px;
  J_COLOR_SPACE colours;
  struct Part {
    std::uint32_t across, down, blocks_across, blocks_down;
    std::array<std::uint16_t, 64> steps;
    const std::int16_t* blocks;  // 64 each, row by row
  };
  std::array<Part, 3> parts;
  std::size_t count = 0;
};

void set_up(jpeg_compress_struct& info, const CoefficientFile& file) {
  info.image_width = file.width_px;
  info.image_height = file.height_px;
  info.input_components = static_cast<int>(file.count);
  info.in_color_space = file.colours;
  jpeg_set_defaults(&info);
  jpeg_set_colorspace(&info, file.colours);
  for (std::size_t c = 0; c < file.count; ++c) {
    jpeg_component_info& to = info.comp_info[c];
    to.h_samp_factor = static_cast<int>(file.parts[c].across);
    to.v_samp_factor = static_cast<int>(file.parts[c].down);
    to.quant_tbl_no = static_cast<int>(c);
    if (!info.quant_tbl_ptrs[c])
      info.quant_tbl_ptrs[c] = jpeg_alloc_quant_table(reinterpret_cast<j_common_ptr>(&info));
    for (std::size_t k = 0; k < DCTSIZE2; ++k) info.quant_tbl_ptrs[c]->quantval[k] = file.parts[c].steps[k];
  }
  info.optimize_coding = TRUE;
  jpeg_simple_progression(&info);
}

/// Between them the arrays are allocated, and nothing is coded yet: libjpeg codes when it finishes.
void write_blocks(jpeg_compress_struct& info, const CoefficientFile& file) {
  auto* common = reinterpret_cast<j_common_ptr>(&info);
  jvirt_barray_ptr arrays[3];
  for (std::size_t c = 0; c < file.count; ++c) {
    const CoefficientFile::Part& part = file.parts[c];
    arrays[c] = info.mem->request_virt_barray(common, JPOOL_IMAGE, TRUE,
                                              divided_up(part.blocks_across, part.across) * part.across,
                                              divided_up(part.blocks_down, part.down) * part.down, part.down);
  }
  jpeg_write_coefficients(&info, arrays);
  for (std::size_t c = 0; c < file.count; ++c) {
    const CoefficientFile::Part& part = file.parts[c];
    for (std::uint32_t row = 0; row < part.blocks_down; ++row) {
      JBLOCKROW to = *info.mem->access_virt_barray(common, arrays[c], row, 1, TRUE);
      const std::int16_t* from = part.blocks + std::size_t{64} * row * part.blocks_across;
      std::copy_n(from, std::size_t{64} * part.blocks_across, &to[0][0]);
    }
  }
  jpeg_finish_compress(&info);
}

std::vector<std::uint8_t> coded_coefficients(const CoefficientFile& file) {
  JpegWriter writer;
  const bool ok = jpeg_guarded(writer.errors, [&] {
    jpeg_mem_dest(&writer.info, &writer.data, &writer.size);
    set_up(writer.info, file);
    write_blocks(writer.info, file);
  });
  if (!ok) throw StageError("extract", "image", "coefficients that a JPEG can hold", writer.errors.message);
  return writer.file();
}

struct TexelRange {
  std::int64_t begin, end;
};

bool any_covered(const CoverageMask& mask, TexelRange x, TexelRange y) {
  x = {std::max<std::int64_t>(x.begin, 0), std::min<std::int64_t>(x.end, mask.width_px)};
  y = {std::max<std::int64_t>(y.begin, 0), std::min<std::int64_t>(y.end, mask.height_px)};
  for (auto v = static_cast<std::uint32_t>(y.begin); v < y.end; ++v)
    for (auto u = static_cast<std::uint32_t>(x.begin); u < x.end;) {
      const bool whole = u % 8 == 0 && u + 8 <= x.end;
      if (whole ? mask.byte_at(u, v) != 0 : mask.covered(u, v)) return true;
      u += whole ? 8 : 1;
    }
  return false;
}

std::int16_t requantised(std::int16_t value, std::uint16_t from, std::uint16_t to) {
  const int product = std::abs(int{value}) * from, rounded = (2 * product + to) / (2 * to);
  return static_cast<std::int16_t>(value < 0 ? -rounded : rounded);
}

}  // namespace

bool holds_source(const TextureInfo& info) { return info.source_rung; }

/// The fragments' files of one rung.
class JoinedJpeg::Fragments {
 public:
  Fragments(PackageReader& package, std::uint32_t plane, std::size_t rung)
      : info_(package.textures().at(plane)),
        path_(info_.rungs.at(rung).path),
        streams_(info_.codec, package.tables().planes.at(plane), package.entry(info_.tables)) {
    if (info_.codec != Codec::kJpeg) throw FormatError(path_, "", "a plane of codec jpeg", "another");
    streams_.add_pack(rung, package.entry(info_.rungs[rung]));
  }
  const TextureInfo& info() const { return info_; }
  bool has(std::size_t fragment) const { return !streams_.stream(fragment).empty(); }
  JpegCoefficients at(std::size_t fragment) const {
    try {
      return JpegCoefficients(path_, streams_.file(fragment));
    } catch (const InputError& e) {  // of no model, but of the package
      throw FormatError(path_, "fragment " + std::to_string(fragment) + ", " + e.place(), e.expected(),
                        e.found());
    }
  }
  [[noreturn]] void fail(std::size_t fragment, std::string expected) const {
    throw FormatError(path_, "fragment " + std::to_string(fragment), std::move(expected), "another");
  }

 private:
  const TextureInfo& info_;
  const std::string& path_;
  PlaneStreams streams_;
};

JoinedJpeg::JoinedJpeg(PackageReader& package, std::uint32_t plane, std::size_t rung,
                       const RunContext& context) {
  const Fragments fragments(package, plane, rung);
  const TextureInfo& info = fragments.info();
  width_px_ = info.width_px, height_px_ = info.height_px;
  fragment_width_px_ = info.fragment_width_px, fragment_height_px_ = info.fragment_height_px;
  columns_ = info.columns;
  std::vector<std::uint8_t> stored(package.tables().planes.at(plane).fragment_count());
  std::vector<std::size_t> parts;
  for (std::size_t f = 0; f < stored.size(); ++f)
    if ((stored[f] = fragments.has(f))) parts.push_back(f);
  if (parts.empty()) throw FormatError(info.rungs[rung].path, "", "a stored fragment", "none");
  set_components(fragments, parts.front());
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) put_fragment(fragments, parts[i]);
  });
  fill_gaps(stored);
}

std::array<std::uint32_t, 2> JoinedJpeg::mcu_px() const {
  std::array<std::uint32_t, 2> out{8, 8};
  for (const Component& c : components_) out = {std::max(out[0], 8 * c.across), std::max(out[1], 8 * c.down)};
  return out;
}

void JoinedJpeg::set_components(const Fragments& fragments, std::size_t first) {
  const JpegCoefficients one = fragments.at(first);
  if (!one.is_plain() || one.components().size() != fragments.info().channels)
    fragments.fail(first, "a grey, YCbCr or RGB JPEG with the plane's channels");
  rgb_ = one.is_rgb();
  for (const JpegCoefficients::Component& from : one.components()) {
    Component& to = components_.emplace_back();
    // What is sampled alone is not subsampled, whatever its factors say.
    to.across = one.components().size() == 1 ? 1 : from.across;
    to.down = one.components().size() == 1 ? 1 : from.down;
    to.quantisers = from.quantisers;
  }
  const auto [mcu_width, mcu_height] = mcu_px();
  if (fragment_width_px_ % mcu_width != 0 || fragment_height_px_ % mcu_height != 0)
    fragments.fail(first, "sides of whole MCUs");
  for (Component& c : components_) {
    c.blocks_across = divided_up(std::uint64_t{width_px_} * c.across, mcu_width);
    c.blocks_down = divided_up(std::uint64_t{height_px_} * c.down, mcu_height);
    c.blocks.resize(std::size_t{c.blocks_across} * c.blocks_down);
  }
}

void JoinedJpeg::put_fragment(const Fragments& fragments, std::size_t fragment) {
  const JpegCoefficients from = fragments.at(fragment);
  if (from.width_px() != fragment_width_px_ || from.height_px() != fragment_height_px_ ||
      from.components().size() != components_.size() || from.is_rgb() != rgb_)
    fragments.fail(fragment, "a fragment like the first one");
  const auto [mcu_width, mcu_height] = mcu_px();
  const auto column = static_cast<std::uint32_t>(fragment % columns_),
             row = static_cast<std::uint32_t>(fragment / columns_);
  for (std::size_t c = 0; c < components_.size(); ++c) {
    Component& to = components_[c];
    if (from.components()[c].quantisers != to.quantisers)
      fragments.fail(fragment, "the first one's quantisers");
    const std::uint32_t across = fragment_width_px_ / mcu_width * to.across,
                        down = fragment_height_px_ / mcu_height * to.down;
    for (std::uint32_t y = 0; y < down && row * down + y < to.blocks_down; ++y)
      for (std::uint32_t x = 0; x < across && column * across + x < to.blocks_across; ++x)
        std::copy_n(from.block(c, y, x), 64,
                    to.blocks[std::size_t{row * down + y} * to.blocks_across + column * across + x].begin());
  }
}

void JoinedJpeg::fill_gaps(const std::vector<std::uint8_t>& stored) {
  const auto [mcu_width, mcu_height] = mcu_px();
  for (Component& c : components_) {
    const std::uint32_t across = fragment_width_px_ / mcu_width * c.across,
                        down = fragment_height_px_ / mcu_height * c.down;
    for (std::uint32_t y = 0; y < c.blocks_down; ++y)
      for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
        if (stored[std::size_t{y / down} * columns_ + x / across]) continue;
        const std::size_t at = std::size_t{y} * c.blocks_across + x;
        if (at > 0) c.blocks[at][0] = c.blocks[x > 0 ? at - 1 : at - c.blocks_across][0];
      }
  }
}

void JoinedJpeg::fill_unseen(const std::vector<std::uint8_t>& coverage) {
  const CoverageMask mask(coverage, width_px_, height_px_);
  for (Component& c : components_) continue_means(c, known_blocks(c, mask));
  flatten(mask);
}

/// By block: 1 where a sample is read for a covered texel, by decoders that interpolate, or where the block
/// holds more than a mean.
std::vector<std::uint8_t> JoinedJpeg::known_blocks(const Component& c, const CoverageMask& mask) const {
  const auto [mcu_width, mcu_height] = mcu_px();
  const std::int64_t wide = mcu_width / c.across, high = mcu_height / c.down;  // texels of a block
  const std::int64_t beside_x = wide / 8 - 1, beside_y = high / 8 - 1;
  std::vector<std::uint8_t> out(c.blocks.size());
  for (std::uint32_t y = 0; y < c.blocks_down; ++y)
    for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
      const std::size_t at = std::size_t{y} * c.blocks_across + x;
      const Block& block = c.blocks[at];
      const bool more = std::any_of(block.begin() + 1, block.end(), [](std::int16_t v) { return v != 0; });
      out[at] = more || any_covered(mask, {x * wide - beside_x, (x + 1) * wide + beside_x},
                                    {y * high - beside_y, (y + 1) * high + beside_y});
    }
  return out;
}

void JoinedJpeg::continue_means(Component& c, std::vector<std::uint8_t> known) {
  const auto beside = [&](std::size_t at, const auto& visit) {
    const std::size_t x = at % c.blocks_across, y = at / c.blocks_across;
    for (std::size_t v = y - std::min<std::size_t>(y, 1); v < std::min<std::size_t>(y + 2, c.blocks_down);
         ++v)
      for (std::size_t u = x - std::min<std::size_t>(x, 1); u < std::min<std::size_t>(x + 2, c.blocks_across);
           ++u)
        visit(v * c.blocks_across + u);
  };
  std::vector<std::size_t> ring, next;
  for (std::size_t at = 0; at < known.size(); ++at)
    if (known[at]) ring.push_back(at);
  constexpr std::uint8_t kWaits = 2;
  for (; !ring.empty(); std::swap(ring, next)) {
    next.clear();
    for (const std::size_t at : ring)
      beside(at, [&](std::size_t other) {
        if (known[other] == 0) known[other] = kWaits, next.push_back(other);
      });
    for (const std::size_t at : next) {
      int sum = 0, count = 0;
      beside(at, [&](std::size_t other) {
        if (known[other] == 1) sum += c.blocks[other][0], ++count;
      });
      c.blocks[at][0] = static_cast<std::int16_t>(sum / count);
    }
    for (const std::size_t at : next) known[at] = 1;
  }
}

void JoinedJpeg::flatten(const CoverageMask& mask) {
  const auto [mcu_width, mcu_height] = mcu_px();
  const std::uint32_t across = divided_up(width_px_, mcu_width), down = divided_up(height_px_, mcu_height);
  // With a border of one on each side, so that every MCU has neighbours.
  std::vector<std::uint8_t> near(std::size_t{across + 2} * (down + 2));
  for (std::uint32_t y = 0; y < height_px_; ++y)
    for (std::uint32_t x = 0; x < width_px_; ++x) {
      if (!mask.covered(x, y)) continue;
      const std::size_t corner = std::size_t{y / mcu_height} * (across + 2) + x / mcu_width;
      for (std::size_t j = 0; j < 3; ++j)
        std::fill_n(near.begin() + static_cast<std::ptrdiff_t>(corner + j * (across + 2)), 3,
                    std::uint8_t{1});
      x = std::min(x / mcu_width * mcu_width + mcu_width, width_px_) - 1;
    }
  for (Component& c : components_)
    for (std::uint32_t y = 0; y < c.blocks_down; ++y)
      for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
        if (near[std::size_t{y / c.down + 1} * (across + 2) + x / c.across + 1]) continue;
        Block& block = c.blocks[std::size_t{y} * c.blocks_across + x];
        std::fill(block.begin() + 1, block.end(), std::int16_t{0});
      }
}

std::vector<std::uint8_t> JoinedJpeg::file(double quality) const {
  CoefficientFile out{width_px_,
                      height_px_,
                      components_.size() == 1 ? JCS_GRAYSCALE
                      : rgb_                  ? JCS_RGB
                                              : JCS_YCbCr,
                      {},
                      components_.size()};
  std::vector<std::vector<Block>> coarser(components_.size());
  for (std::size_t c = 0; c < components_.size(); ++c) {
    const Component& from = components_[c];
    CoefficientFile::Part& part = out.parts[c];
    part = {from.across,      from.down,       from.blocks_across,
            from.blocks_down, from.quantisers, from.blocks[0].data()};
    for (std::size_t k = 0; k < 64; ++k)
      part.steps[k] = std::max(part.steps[k], texture_step(k, std::clamp(quality, 1.0, 100.0)));
    if (part.steps == from.quantisers) continue;
    coarser[c] = from.blocks;
    for (Block& block : coarser[c])
      for (std::size_t k = 0; k < 64; ++k)
        if (part.steps[k] != from.quantisers[k])
          block[k] = requantised(block[k], from.quantisers[k], part.steps[k]);
    part.blocks = coarser[c][0].data();
  }
  return coded_coefficients(out);
}

}  // namespace texmesh
