#pragma once
#include <cstddef>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "tools/extract/budget/image_coder.h"

namespace texmesh {

/// Losses in the same pixels, of a mesh and of the images of a material, join about as the sum of their
/// squares. (Predicted so, what was rendered was 0.94 to 0.98 of it on five scans.) Losses in other pixels
/// just add up.
inline double joined(double loss) { return loss * loss; }

/// A file of one image, and what it costs in the pictures.
struct CodedImage {
  ImagePlan plan;
  double bytes = 0;
  double loss = 0;  // joined(FLIP) with everything else at its best
};

/// What becomes of all images in so many bytes.
struct Allocation {
  std::vector<CodedImage> images;  // by image; bytes and loss of the one between two files are between theirs
  double bytes = 0;
  double loss = 0;       // joined(FLIP) of all images together
  std::size_t last = 0;  // the image that got the last bytes
};

/// For each image the files that give most for their bytes, found by rendering S_0 with one image changed at
/// a time.
class LossCurves {
 public:
  LossCurves(BudgetSource& source, ImageCoder& coder) : source_(source), coder_(coder) {}
  /// Measures files around what each image may get of `bytes` for all of them. What was measured for other
  /// bytes is remembered and changes nothing but the time.
  void measure(double bytes);
  /// The least loss of at most `bytes`; the smallest files where nothing fits.
  Allocation allocate(double bytes) const;
  /// Another file of an image on its curve, that with next more bytes than `from`, or next fewer with a step
  /// of -1; null where there is none.
  const CodedImage* neighbour(std::size_t image, const CodedImage& from, int step) const;

 private:
  using TrialKey = std::tuple<std::size_t, int, TextureCoding, double>;
  struct Trial {
    std::size_t image = 0;
    int step = 0;
    TextureCoding coding;
    double quality = 0;
    TrialKey key() const { return {image, step, coding, quality}; }
  };
  /// The trials that are of use and new.
  class Trials;
  void render(const std::vector<Trial>& trials);
  void render_part(std::span<const Trial> trials);
  void find_curves();
  double likely_bytes(std::size_t image, double bytes) const;
  std::vector<Trial> first_trials(double bytes) const;
  std::vector<Trial> trials_around_first(double bytes) const;
  std::vector<Trial> trials_around(const Allocation& chosen, double bytes) const;
  Allocation allocate(double bytes, const std::vector<double>& group_weights) const;
  std::vector<double> group_losses(const Allocation& allocation) const;
  BudgetSource& source_;
  ImageCoder& coder_;
  std::map<TrialKey, CodedImage> measured_;             // all that were ever rendered
  std::vector<std::vector<CodedImage>> seen_, curves_;  // by image; curves by rising bytes, convex
};

}  // namespace texmesh
