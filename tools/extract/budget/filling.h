#pragma once

#include "tools/extract/budget/candidates.h"

namespace texmesh {

/// The quality, of those tried, for which bytes(quality) comes nearest to `wanted` from below; the lowest one
/// where none does. By the secant of the bytes' logarithm from `start`, until `near` of `wanted` is reached.
/// Calls bytes() at most `tries` times; it should grow with the quality. `learns`: the secant
/// is that of the last two bytes, wherever they lie, and from the third try on twice as far is near enough.
double quality_for(double wanted, double start, double near, int tries,
                   const std::function<std::uint64_t(double)>& bytes, bool learns = false);

/// A mesh as files of a number of bytes have it, with as much of what is known of the object as they may say.
struct MeshFile {
  std::shared_ptr<const StandaloneGlb> file;
  std::uint64_t fixed_bytes = 0;  // without its images' bytes
  /// The file with these images. An image that is not given has no bytes.
  std::vector<std::uint8_t> with(const std::map<std::uint32_t, FileImageData>& images) const;
};

/// A file, with a row of the report for each of its images.
struct FilledFile {
  std::map<std::uint32_t, FileImageData> images;  // by source image
  std::vector<ExtractedImage> rows;               // by image
  std::vector<std::uint8_t> glb;
  bool has_sources = false;  // all images are the source's, as the package holds them
};

/// Fills a number of bytes: the largest file within them by quality, then by size of the textures.
class Filling {
 public:
  Filling(const Reference& reference, Candidates& candidates, std::uint64_t bytes)
      : reference_(reference), candidates_(candidates), bytes_(bytes) {}
  MeshFile mesh_file(const MeshCandidate& mesh) const;
  /// Where nothing fits: the smallest file.
  FilledFile fill(const MeshFile& mesh, const DealtBytes& allocation) const;
  bool fits(const FilledFile& file) const { return file.glb.size() <= bytes_; }
  bool fills(const FilledFile& file) const;  // to 98 %

 private:
  /// Images while a file is looked for.
  struct Draft {
    std::vector<ImagePlan> plans;
    std::vector<Pixels> pixels;
    std::vector<FileImageData> files;
    std::vector<ImagePlan> coded;  // what `files` were made by
  };
  Draft draft_of(const std::vector<ImagePlan>& plans) const;
  void encode(Draft& draft, const std::vector<std::size_t>& images) const;
  void resize(Draft& draft, const std::vector<ImagePlan>& plans, double times) const;
  void set_pixels(Draft& draft, std::size_t image) const;
  FilledFile file_of(const MeshFile& mesh, const Draft& draft) const;
  /// Makes the file that fills best of those with level 1 .. 100 of `at`, which grow with it.
  void by_level(double start, double near, int tries, const std::function<FilledFile(double level)>& at,
                FilledFile& best) const;
  void by_source(const MeshFile& mesh, const DealtBytes& allocation, Draft& draft, FilledFile& best) const;
  double likely_quality(const Draft& draft, std::size_t image, const FilledFile& file) const;
  void by_last_image(const MeshFile& mesh, std::size_t last, Draft& draft, FilledFile& best) const;
  void by_all_qualities(const MeshFile& mesh, Draft& draft, FilledFile& best) const;
  void by_sizes(const MeshFile& mesh, Draft& draft, FilledFile& best) const;
  void by_codings(const MeshFile& mesh, Draft& draft, FilledFile& best) const;
  void replace_if_larger(FilledFile&& file, FilledFile& best) const;
  FilledFile smallest(const MeshFile& mesh) const;
  const Reference& reference_;
  Candidates& candidates_;
  const std::uint64_t bytes_;
};

}  // namespace texmesh
