#pragma once
// Inside the ladder only: what rungs lose, measured in a few windows of a plane, and which are worth storing.
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/ladder/rung_value.h"

namespace texmesh {

/// The full-size plane `base` and its mips, by level.
std::vector<std::size_t> chain_of(const Fragments& fragments, std::size_t base);

/// The fragments that measure_rungs() looks at. [plane][fragment], 1 or 0.
std::vector<std::vector<std::uint8_t>> choice_sample(const Fragments& fragments);

/// The rungs that show the texture of plane `base`. Where a ladder lacks fragments, bytes are what those it
/// has let expect of the covered texels. The rung of the source's coefficients is fixed. Losses are measured
/// in up to 6 windows of up to 128 px of the wanted level, in covered fragments evenly spread in index order:
/// what is shown, scaled up bilinearly as a client does, against the wanted level's `pixels`, over covered
/// texels; luma of colours, counted twice where their chroma is halved, but at most .02 more, every channel
/// of data. Each window weighs as much as its fragment's surface. `planes` are ladders of `fragments`;
/// `preview_file` is a complete JPEG. Same result for any thread count.
TextureRungs measure_rungs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const std::vector<PlaneLadder>& planes, std::size_t base,
                           const std::vector<std::uint8_t>& preview_file, const RunContext& context);

/// The rungs that are worth storing, by plane: rising indices into the rungs of `sample`, which holds at
/// least the fragments of choice_sample() at every candidate rung, of full-size planes and mips. What
/// pairs_worth_storing() keeps of 1,000 simulated loads of all textures together; the rung of a
/// source's coefficients always, and of the finest quality of a source without loss where this takes at most
/// 1.25 times the source's bytes. All rungs of a texture whose image is a JPEG, mips and tables included,
/// take at most 1.9 times the image's bytes, where that leaves one rung of each plane; of a ladder that lacks
/// fragments this holds for the bytes that measure_rungs() expects. `images` as in encode_ladder().
/// Incremental codecs need every rung below one that is kept. `previews` are those of all full-size planes.
/// Same result for any thread count.
std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, const std::vector<Image>& images,
                                                   const RunContext& context);

/// Whether an image's texels were never coded with a loss, as far as its format tells.
bool is_lossless(const Image& image);

/// What all rungs of the texture of plane `base` may take together.
double most_bytes(const TexturePlane& base, const std::vector<Image>& images);

}  // namespace texmesh
