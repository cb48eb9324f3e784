#pragma once
// Inside the room only: libjpeg's compressor, and the steps of JPEGs that are shown on models.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "format/base/errors.h"
#include "stages/jpeg/jpeg_guard.h"

namespace texmesh {

/// Everything that libjpeg's compressor owns is freed whatever happens.
struct JpegWriter {
  jpeg_compress_struct info{};
  JpegErrors errors;
  unsigned char* data = nullptr;  // of jpeg_mem_dest, which allocates by malloc
  unsigned long size = 0;

  JpegWriter() {
    info.err = &errors.base;
    if (!jpeg_guarded(errors, [this] { jpeg_create_compress(&info); }))
      throw StageError("extract", "image", "a JPEG coder", errors.message);
  }
  ~JpegWriter() {
    jpeg_destroy_compress(&info);
    std::free(data);
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;
  std::vector<std::uint8_t> file() const { return {data, data + size}; }
};

/// libjpeg's scale of steps, in percent of a table; qualities need not be whole: whole ones are some percent
/// of bytes apart.
double percent_of_steps(double quality);

/// The step of coefficient i of an 8 x 8 block, row by row, at a quality of 1..100, for pictures of models,
/// where textures are shown smaller, turned and filtered: what is coarse in a block shows everywhere, what is
/// fine hardly. 4 at quality 50 and rising with the square of the frequency, the same for chroma. At equal
/// bytes FLIP was 2 % (turtle) to 33 % (yurt) less than with libjpeg's tables.
std::uint16_t texture_step(std::size_t i, double quality);

}  // namespace texmesh
