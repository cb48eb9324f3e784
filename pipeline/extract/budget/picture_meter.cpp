#include "pipeline/extract/budget/picture_meter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "format/base/box.h"
#include "format/base/errors.h"
#include "format/base/srgb.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr int kSamples = 4;                     // of a pixel, as look_at() takes them
constexpr float kBackground = 0.2f;             // linear, as the quality stage's
constexpr std::uint32_t kReference = 1u << 12;  // side of the texture that look_at() is told

/// Two neighbouring texels along an axis and the share of the second.
struct Neighbours {
  std::uint32_t a = 0, b = 0;
  float share = 0;
};
Neighbours neighbours(float x, std::uint32_t size, bool repeat) {
  const float at = x * static_cast<float>(size) - 0.5f, low = std::floor(at);
  const auto i = static_cast<std::int64_t>(low), n = static_cast<std::int64_t>(size);
  const auto place = [&](std::int64_t k) {
    return static_cast<std::uint32_t>(repeat ? ((k % n) + n) % n : std::clamp<std::int64_t>(k, 0, n - 1));
  };
  return {place(i), place(i + 1), at - low};
}

Vec3f bilinear(const MipTexture::Level& l, Vec2f uv, bool repeat_s, bool repeat_t) {
  const Neighbours x = neighbours(uv.x, l.width, repeat_s), y = neighbours(uv.y, l.height, repeat_t);
  const auto texel = [&l](std::uint32_t i, std::uint32_t j) {
    return l.texels[std::size_t{j} * l.width + i];
  };
  const Vec3f top = texel(x.a, y.a) * (1 - x.share) + texel(x.b, y.a) * x.share;
  const Vec3f bottom = texel(x.a, y.b) * (1 - x.share) + texel(x.b, y.b) * x.share;
  return top * (1 - y.share) + bottom * y.share;
}

/// As graphics cards do it: between the two levels whose texels are nearest to the footprint in size.
Vec3f trilinear(const MipTexture& texture, Vec2f uv, float area, bool repeat_s, bool repeat_t) {
  float texels = area * static_cast<float>(texture.width_px) * static_cast<float>(texture.height_px);
  std::size_t level = 0;
  for (; texels >= 4 && level + 1 < texture.levels.size(); texels /= 4) ++level;
  const Vec3f fine = bilinear(texture.levels[level], uv, repeat_s, repeat_t);
  if (texels <= 1 || level + 1 == texture.levels.size()) return fine;
  // log2 of the side, 0 .. 1 for areas of 1 .. 4: linear in the side is near enough.
  const float share = std::sqrt(texels) - 1;
  return fine * (1 - share) + bilinear(texture.levels[level + 1], uv, repeat_s, repeat_t) * share;
}

Vec3f product(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

}  // namespace

MipTexture mip_texture(const Pixels& pixels) {
  const auto& linear = light_of_bytes();
  MipTexture out;
  out.width_px = pixels.width_px;
  out.height_px = pixels.height_px;
  MipTexture::Level& level = out.levels.emplace_back();
  level.width = pixels.width_px;
  level.height = pixels.height_px;
  level.texels.resize(std::size_t{level.width} * level.height);
  const std::uint8_t* from = pixels.data.data();
  for (Vec3f& texel : level.texels) {
    texel = pixels.channels >= 3 ? Vec3f{linear[from[0]], linear[from[1]], linear[from[2]]}
                                 : Vec3f{linear[from[0]], linear[from[0]], linear[from[0]]};
    from += pixels.channels;
  }
  build_mips(out);
  return out;
}

std::vector<ViewCamera> cameras_around(const Mesh& mesh, int count) {
  if (mesh.positions.empty()) throw StageError("extract", "S_0", "positions", "none");
  const auto [centre, radius] = bounding_sphere(mesh.positions);
  if (!(radius > 0)) throw StageError("extract", "S_0", "an extent above 0", "one point");
  std::vector<ViewCamera> out;
  for (int v = 0; v < count; ++v) out.push_back(camera_of(v, count, centre, radius));
  return out;
}

ModelViews::ModelViews(const ShownModel& model, const std::vector<ViewCamera>& cameras, std::uint32_t side_px,
                       const RunContext& context)
    : side_px_(side_px), names_(model.image_names), views_(cameras.size()) {
  const Mesh& mesh = *model.mesh;
  std::vector<std::uint32_t> source(mesh.triangles.size());
  for (std::uint32_t t = 0; t < source.size(); ++t) source[t] = t;
  ViewScene scene;
  scene.mesh = model.mesh;
  scene.triangles = &mesh.triangles;
  scene.triangle_source = &source;
  scene.materials = model.materials;
  for (const Material& m : *model.materials) {
    const auto shown = [&](const TextureRef& ref) {
      const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
      return ref.used() && ref.texcoord < 2 && !uv.empty() ? ref.image : -1;
    };
    scene.base_plane.push_back(shown(m.base_colour_texture));
    scene.emissive_plane.push_back(shown(m.emissive_texture));
  }
  scene.sizes.assign(names_.size(), {kReference, kReference});
  parallel_for(context, cameras.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) add_view(look_at(scene, cameras[v], side_px), views_[v]);
  });
}

void ModelViews::add_view(const ViewBuffer& buffer, View& view) const {
  constexpr float kShare = 1.f / (static_cast<float>(kReference) * static_cast<float>(kReference));
  view.hits = buffer.hits;
  view.samples.reserve(buffer.samples.size());
  for (const ViewSample& s : buffer.samples) {
    view.samples.push_back(
        {s.pixel, s.base_plane, s.base_uv, s.base_area * kShare, s.factor, s.base_repeat_s, s.base_repeat_t});
    if (s.emission == Vec3f{}) continue;
    view.samples.push_back({s.pixel, s.emissive_plane, s.emissive_uv, s.emissive_area * kShare, s.emission,
                            s.emissive_repeat_s, s.emissive_repeat_t});
  }
}

std::vector<Picture> ModelViews::draw(const std::map<std::string, MipTexture>& textures,
                                      const RunContext& context) const {
  std::vector<const MipTexture*> by_image;
  for (const std::string& name : names_) {
    const auto found = textures.find(name);
    by_image.push_back(found == textures.end() ? nullptr : &found->second);
  }
  std::vector<Picture> out(views_.size());
  parallel_for(context, views_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      Picture& picture = out[v];
      picture.side_px = side_px_;
      picture.linear.resize(views_[v].hits.size());
      picture.covered.resize(views_[v].hits.size());
      for (std::size_t i = 0; i < picture.linear.size(); ++i) {
        const float background = kBackground * static_cast<float>(kSamples - views_[v].hits[i]) / kSamples;
        picture.linear[i] = {background, background, background};
        picture.covered[i] = views_[v].hits[i] > 0;
      }
      for (const Sample& s : views_[v].samples) {
        Vec3f c = s.factor;
        if (s.image >= 0 && by_image[static_cast<std::size_t>(s.image)])
          c = product(c, trilinear(*by_image[static_cast<std::size_t>(s.image)], s.uv, s.area, s.repeat_s,
                                   s.repeat_t));
        picture.linear[s.pixel] = picture.linear[s.pixel] + c * (1.f / kSamples);
      }
    }
  });
  return out;
}

PictureMeter::PictureMeter(const std::vector<Picture>& reference, const RunContext& context)
    : reference_(reference.size()) {
  parallel_for(context, reference.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) reference_[v] = prepare_flip(reference[v]);
  });
}

double PictureMeter::difference(const std::vector<Picture>& test, const RunContext& context) const {
  std::vector<double> parts(reference_.size());
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) parts[v] = flip_of(reference_[v], prepare_flip(test[v]));
  });
  double sum = 0;
  for (const double p : parts) sum += p;
  return parts.empty() ? 0 : sum / static_cast<double>(parts.size());
}

}  // namespace texmesh
