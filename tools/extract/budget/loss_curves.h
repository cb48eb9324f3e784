#pragma once
#include <cstddef>

#include "tools/extract/budget/candidates.h"

namespace texmesh {

/// What becomes of all images in so many bytes.
struct DealtBytes {
  std::vector<CodedImage> images;  // by image; bytes and loss of the one between two files are between theirs
  double bytes = 0;
  double loss = 0;       // joined(FLIP) of all images together
  std::size_t last = 0;  // the image that got the last bytes
};

/// For each image the files that give most for their bytes, found by rendering S_0 with one image changed at
/// a time. Constant once made.
class LossCurves {
 public:
  /// Looks at files around what each image may get of `bytes` for all of them.
  LossCurves(const Reference& reference, Candidates& candidates, double bytes);
  /// The least loss of at most `bytes`; the smallest files where nothing fits.
  DealtBytes allocate(double bytes) const;
  /// Another file of an image on its curve, that with next more bytes than `from`, or next fewer with a step
  /// of -1; null where there is none.
  const CodedImage* neighbour(std::size_t image, const CodedImage& from, int step) const;

 private:
  class Trials;
  void look_at(const std::vector<ImageTrial>& trials);
  void find_curves();
  double likely_bytes(std::size_t image, double bytes) const;
  std::vector<ImageTrial> first_trials(double bytes) const;
  std::vector<ImageTrial> trials_around_first(double bytes) const;
  std::vector<ImageTrial> trials_around(const DealtBytes& chosen, double bytes) const;
  DealtBytes allocate(double bytes, const std::vector<double>& group_weights) const;
  std::vector<double> group_losses(const DealtBytes& allocation) const;
  const Reference& reference_;
  Candidates& candidates_;
  std::vector<std::vector<CodedImage>> seen_, curves_;  // by image; curves by rising bytes, convex
};

}  // namespace texmesh
