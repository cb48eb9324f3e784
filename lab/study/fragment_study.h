#pragma once

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// A plane of three channels that shows the surface in every texel: `columns` x `rows` fragments of one size
/// with equal parts of the surface and no features. All four above 0.
TexturePlane covered_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t fragment_width_px,
                           std::uint32_t fragment_height_px);

/// Thesis 3.3.1: what does cutting a texture into fragments cost?
struct FragmentStudyOptions {
  std::vector<int> grids{2, 4, 8, 16};                      // fragments in a row and in a column, 1..64
  std::vector<int> qualities{10, 20, 40, 60, 80, 90, 100};  // IJG, strictly rising, at most 16
  Subsampling subsampling = Subsampling::k420;
  /// Files with tables of their own, too, which take as long to make as all the rest; without them their
  /// sizes are 0.
  bool optimised = true;
  /// Seconds of CPU that this thread has taken; empty: decoding is not timed.
  std::function<double()> clock_s{};
};

/// One grid at one quality; bytes. Of quality 100 files and fragments have their channels apart
/// (kFinestQuality). "Standard" files have the Huffman tables of ISO 10918-1 annex K.3 and a
/// JFIF header, as most programs write them; "optimised" ones have tables made for them; "shared" is what
/// packages hold: abbreviated streams behind one table stream, which is counted.
struct FragmentStudyRow {
  int grid = 0, quality = 0;
  std::uint32_t columns = 0, rows = 0;  // at most grid: fragments without a pixel of the image do not count
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0;
  std::uint64_t file_standard = 0, file_optimised = 0;                // the whole image in one file
  std::uint64_t sum_standard = 0, sum_optimised = 0, sum_shared = 0;  // of the columns * rows fragments
  // Seconds of one thread, the least of three times, where a clock is given: of the image as one file with
  // tables of its own, and of all fragments as packages hold them, each made a whole file again. The only
  // figures that differ from run to run.
  double file_decode_s = 0, fragments_decode_s = 0;
};

/// By grid, then quality, as the options list them; a grid that is listed twice counts once. Fragments have
/// sides that are multiples of 16 and at least image side / grid, the image's edges repeated to fill them
/// ("the entire texture is adjusted so that there is no partial fragment"), and there are as many as the
/// image reaches into. `pixels` have 1 or 3 channels. Throws StageError for options or pixels outside these
/// ranges. Same result for any thread count, times apart.
std::vector<FragmentStudyRow> study_fragments(const Pixels& pixels, const FragmentStudyOptions& options,
                                              const RunContext& context);

}  // namespace texmesh
