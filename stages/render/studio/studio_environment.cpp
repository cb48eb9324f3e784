// Read, not computed: 0.15 s is as long as a small model may take.
#include <bit>
#include <span>

#include "stages/render/environment.h"

namespace texmesh {

/// The studio's environment as make_studio_table wrote it when the library was built: bits of floats, sides
/// of levels as numbers, in the order of RenderEnvironment's members without key and background.
std::span<const std::uint32_t> studio_table();

namespace {

/// Takes the table's words one after the other.
class StudioWords {
 public:
  std::uint32_t next() {
    if (at_ == words_.size()) throw std::logic_error("the studio's table is too short");
    return words_[at_++];
  }
  Vec4f colour() {
    Vec4f out;
    for (float* channel : {&out.x, &out.y, &out.z}) *channel = std::bit_cast<float>(next());
    return out;
  }
  bool at_end() const { return at_ == words_.size(); }

 private:
  std::span<const std::uint32_t> words_ = studio_table();
  std::size_t at_ = 0;
};

}  // namespace

RenderEnvironment studio_environment() {
  RenderEnvironment out;
  out.key = studio_key_light();
  StudioWords words;
  for (Vec4f& c : out.irradiance) c = words.colour();
  while (!words.at_end()) {
    RenderEnvironment::Level& level = out.levels.emplace_back();
    level.side = words.next();
    level.texels.resize(static_cast<std::size_t>(level.side) * level.side);
    for (Vec4f& c : level.texels) c = words.colour();
  }
  return out;
}

}  // namespace texmesh
