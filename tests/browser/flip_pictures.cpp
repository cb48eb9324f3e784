// flip_pictures REFERENCE.png PICTURE.png..: mean FLIP of each picture, one line each. Pictures are square
// and of one size; what they show is what is not transparent.
#include <fstream>
#include <iostream>
#include <iterator>

#include "format/base/portable_math.h"
#include "stages/image/decode_image.h"
#include "stages/measure/flip.h"

namespace texmesh {
namespace {

FlipPicture flip_picture(const char* path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<std::uint8_t> file{std::istreambuf_iterator<char>(in), {}};
  const Pixels pixels = decode_image(probe_image(path, file, ImageLimits{}));
  if (pixels.channels != 4 || pixels.width_px != pixels.height_px)
    throw std::runtime_error(std::string(path) + ": expected a square picture of four channels");
  Picture picture{pixels.width_px, {}, {}};
  for (std::size_t i = 0; i < pixels.data.size(); i += 4) {
    const auto light = [&](int c) { return static_cast<float>(light_of_srgb(pixels.data[i + c] / 255.0)); };
    picture.linear.push_back({light(0), light(1), light(2)});
    picture.covered.push_back(pixels.data[i + 3] > 0);
  }
  return prepare_flip(picture);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: flip_pictures REFERENCE.png PICTURE.png..\n";
    return 2;
  }
  try {
    const texmesh::FlipPicture reference = texmesh::flip_picture(argv[1]);
    for (int i = 2; i < argc; ++i)
      std::cout << texmesh::flip_of(reference, texmesh::flip_picture(argv[i])) << '\n';
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
