#include "pipeline/import/combine_images.h"

#include <algorithm>

#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"

namespace texmesh {
namespace {

/// An image of the model, or one white texel.
struct Plane {
  Pixels pixels{1, 1, 1, {255}};
  std::string name;

  Plane(Model& model, CombinedImage from) {
    if (from.index < 0) return;
    const Image& image = model.images.at(static_cast<std::size_t>(from.index));
    std::string damage;
    pixels = decode_image(image, from.encoding, &damage);
    name = image.name;
    if (!damage.empty()) add_warning(model.notes, "damaged-image", name, damage_words(damage));
  }
  /// The texel nearest to (x, y) of a picture of the given size.
  ImageTexel at(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height) const {
    return {pixels.at(static_cast<std::uint32_t>(std::uint64_t{x} * pixels.width_px / width),
                      static_cast<std::uint32_t>(std::uint64_t{y} * pixels.height_px / height)),
            pixels.channels};
  }
};

template <class Texel>
std::int32_t combine(Model& model, const Plane& a, const Plane& b, std::uint32_t channels,
                     const Texel& texel) {
  Pixels out{std::max(a.pixels.width_px, b.pixels.width_px),
             std::max(a.pixels.height_px, b.pixels.height_px),
             channels,
             {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * channels);
  std::uint8_t* to = out.data.data();
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    for (std::uint32_t x = 0; x < out.width_px; ++x, to += channels)
      texel(a.at(x, y, out.width_px, out.height_px), b.at(x, y, out.width_px, out.height_px), to);
  const std::string name = a.name + (a.name.empty() || b.name.empty() ? "" : " + ") + b.name;
  std::vector<std::uint8_t> png = write_png(out);
  for (std::size_t i = 0; i < model.images.size(); ++i)  // several materials may want the same
    if (model.images[i].bytes == png) return static_cast<std::int32_t>(i);
  ImageLimits limits;
  limits.max_pixels = ~0ull;  // of images that were within theirs
  model.images.push_back(probe_image(name, std::move(png), limits));
  return static_cast<std::int32_t>(model.images.size() - 1);
}

}  // namespace

std::int32_t combine_alpha(Model& model, std::int32_t colour, std::int32_t alpha) {
  const Plane a(model, {colour, FloatEncoding::kSrgb}), b(model, {alpha, FloatEncoding::kAsIs});
  const std::uint32_t last = b.pixels.channels - 1;
  bool own_alpha = false;  // of the second image: not all opaque
  for (std::size_t i = last; b.pixels.channels % 2 == 0 && i < b.pixels.data.size(); i += b.pixels.channels)
    own_alpha = own_alpha || b.pixels.data[i] != 255;
  const std::uint32_t from = own_alpha ? last : 0, step = a.pixels.channels >= 3 ? 1 : 0;
  return combine(model, a, b, 4, [&](const ImageTexel& c, const ImageTexel& o, std::uint8_t* to) {
    for (std::uint32_t k = 0; k < 3; ++k) to[k] = c.channel[k * step];
    to[3] = o.channel[from];
  });
}

std::int32_t combine_roughness_metallic(Model& model, std::int32_t roughness, std::int32_t metallic) {
  return combine_images(model, {roughness, FloatEncoding::kAsIs}, {metallic, FloatEncoding::kAsIs}, 3,
                        [](const ImageTexel& r, const ImageTexel& m, std::uint8_t* to) {
                          to[0] = 255;  // occlusion: none
                          to[1] = r.channel[0];
                          to[2] = m.channel[0];
                        });
}

std::int32_t combine_images(
    Model& model, CombinedImage a, CombinedImage b, std::uint32_t channels,
    const std::function<void(const ImageTexel& a, const ImageTexel& b, std::uint8_t* to)>& texel) {
  return combine(model, Plane(model, a), Plane(model, b), channels, texel);
}

}  // namespace texmesh
