#include "stages/ladder/choose_rungs.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "stages/fragment_codec/fragment_codec.h"
#include "stages/ladder/rung_loss.h"
#include "stages/ladder/rung_value.h"

namespace texmesh {
namespace {

// A rung with a tenth of a texture's bytes must lower the loss of loads by so many tenths of this part.
constexpr double kGain = 0.05;
constexpr double kLeastLoads = 0.01;
// Of a JPEG's bytes.
constexpr double kMostOfJpeg = 1.9;
// Of the bytes of a source without loss, for its finest rung to stay whatever it is worth.
constexpr double kMostOfLossless = 1.25;

/// Indices of the rungs that `keep` marks, with those that they lean on.
std::vector<std::size_t> kept_indices(std::vector<std::uint8_t> keep, bool incremental) {
  if (incremental)
    for (std::size_t r = keep.size() - 1; r-- > 0;) keep[r] |= keep[r + 1];
  std::vector<std::size_t> out;
  for (std::size_t r = 0; r < keep.size(); ++r)
    if (keep[r]) out.push_back(r);
  return out;
}

/// Fixes the rung that stands for a source without loss. The others are judged as if it were not there: it
/// has two to three times the bytes of the next one, beside which too many of the others would seem cheap.
void fix_finest(const TexturePlane& base, const PlaneLadder& ladder, const std::vector<Image>& images,
                TextureWays& texture) {
  if (images.empty() || !is_lossless(images[base.image])) return;
  const double most = kMostOfLossless * static_cast<double>(images[base.image].bytes.size());
  for (RungPair& pair : texture.pairs) {
    const bool finest = pair.level == 0 && ladder.rungs[pair.rung].quality == kFinestQuality;
    if (finest && static_cast<double>(pair.bytes) <= most)
      pair.fixed = true;
    else
      texture.whole_bytes = std::max(texture.whole_bytes, pair.bytes);
  }
}

}  // namespace

bool is_lossless(const Image& image) {
  return image.format != ImageFormat::kJpeg && image.format != ImageFormat::kWebp;
}

double most_bytes(const TexturePlane& base, const std::vector<Image>& images) {
  if (images.empty() || images[base.image].format != ImageFormat::kJpeg)
    return std::numeric_limits<double>::infinity();
  return kMostOfJpeg * static_cast<double>(images[base.image].bytes.size());
}

std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, const std::vector<Image>& images,
                                                   const RunContext& context) {
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<TextureWays> textures;
  for (std::size_t base = 0; base < fragments.planes.size() && fragments.planes[base].mip == 0; ++base) {
    textures.push_back(measure_ways(fragments, pixels, sample, base, previews.planes[base].file, quiet));
    textures.back().most_bytes = most_bytes(fragments.planes[base], images);
    fix_finest(fragments.planes[base], sample[base], images, textures.back());
  }
  const auto keep = pairs_worth_storing(textures, texture_loads(), kGain, kLeastLoads);
  std::vector<std::vector<std::size_t>> kept(sample.size());
  for (std::size_t base = 0; base < textures.size(); ++base) {
    auto first = keep[base].begin();
    for (const std::size_t p : chain_of(fragments, base)) {
      const auto last = first + static_cast<std::ptrdiff_t>(sample[p].rungs.size());
      kept[p] = kept_indices({first, last}, codec_traits(sample[p].codec).incremental);
      first = last;
    }
  }
  return kept;
}

}  // namespace texmesh
