#include "format/model/material_extensions.h"
#include "stages/atlas/atlas_parts.h"
#include "stages/image/jpeg_segments.h"
#include "stages/jpeg/source_jpeg.h"
#include "stages/render/render_texture.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kMostHalvings = 4;

ReadPicture picture_of(const TextureRef& reference, TexelKind kind, bool alpha = false) {
  return {reference, kind, 1, alpha};
}

/// Every used texture of a material, in the order of for_each_texture().
std::vector<ReadPicture> used_textures(const Material& m) {
  std::vector<ReadPicture> all;
  all.push_back(picture_of(m.base_colour_texture, TexelKind::kColour, m.alpha_mode != AlphaMode::kOpaque));
  all.push_back(picture_of(m.metallic_roughness_texture, TexelKind::kNumbers));
  all.push_back(picture_of(m.normal_texture, TexelKind::kNormal));
  all.back().normal_scale = m.normal_scale;
  all.push_back(picture_of(m.occlusion_texture, TexelKind::kNumbers));
  all.push_back(picture_of(m.emissive_texture, TexelKind::kColour));
  for (const MaterialExtension& extension : m.extensions)
    for (const ExtensionTexture& t : extension.textures) {
      const MaterialExtensionKind* known = find_material_extension(extension.name);
      const ExtensionTextureKind* kind = known ? known->texture(t.key) : nullptr;
      all.push_back(picture_of(t.texture, kind && kind->colour ? TexelKind::kColour : TexelKind::kNumbers,
                               kind && kind->channels != TextureChannels::kColour));
    }
  std::erase_if(all, [](const ReadPicture& p) { return !p.reference.used(); });
  return all;
}

bool same_texels(const ReadPicture& a, const ReadPicture& b) {
  TextureRef x = a.reference, y = b.reference;
  x.minification = y.minification;
  return x == y && a.kind == b.kind;
}

bool has_directions(const Material& material) {
  for (const MaterialExtension& extension : material.extensions)
    for (const ExtensionTexture& t : extension.textures) {
      const MaterialExtensionKind* known = find_material_extension(extension.name);
      const ExtensionTextureKind* kind = known ? known->texture(t.key) : nullptr;
      if (t.texture.used() && (!kind || kind->tangent_space)) return true;
    }
  return false;
}

std::uint32_t channels_of(const Image& image, const ReadPicture& picture) {
  if (picture.kind == TexelKind::kNormal) return 3;
  if (picture.alpha && image.channels % 2 == 0) return 4;
  return image.channels <= 2 ? 1 : 3;
}

/// Adds a material's pictures, and gives the material with references to them.
Material with_pictures(Material material, std::vector<ReadPicture>& pictures) {
  std::size_t next = 0;
  const std::vector<ReadPicture> used = used_textures(material);
  for_each_texture(material, [&](TextureRef& reference) {
    if (!reference.used()) return;
    const ReadPicture& wanted = used[next++];
    const auto found =
        std::ranges::find_if(pictures, [&](const ReadPicture& p) { return same_texels(p, wanted); });
    const auto index = found - pictures.begin();
    if (found == pictures.end())
      pictures.push_back(wanted);
    else
      found->alpha = found->alpha || wanted.alpha;
    TextureRef out;
    out.image = static_cast<std::int32_t>(index);
    out.wrap_s = out.wrap_t = Wrap::kClamp;
    out.minification = reference.minification;
    reference = out;
  });
  return material;
}

void join_making(JpegMaking& all, const JpegMaking& one) {
  const bool pixels = all.quality == 0 || one.quality == 0;
  all.quality = pixels ? 0 : std::max(all.quality, one.quality);
  all.bytes += one.bytes;
  if (one.subsampling == Subsampling::k444) all.subsampling = one.subsampling;
}

void join_class(MaterialClass& all, const std::vector<ReadPicture>& pictures, std::uint32_t guide,
                const std::vector<Image>& images) {
  const auto image_of = [&](const ReadPicture& p) -> const Image& {
    return images.at(static_cast<std::size_t>(p.reference.image));
  };
  const auto texels = [](const Image& i) { return double(i.width_px) * i.height_px; };
  const double most = texels(image_of(pictures[guide]));
  all.texels += most;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    ClassPicture& picture = all.pictures[i];
    picture.channels = std::max(picture.channels, channels_of(image_of(pictures[i]), pictures[i]));
    std::uint32_t halvings = 0;
    for (double t = 2 * texels(image_of(pictures[i])); t < most && halvings < kMostHalvings; t *= 4)
      ++halvings;
    picture.halvings = std::min(picture.halvings, halvings);
    join_making(picture.jpeg, jpeg_making(image_of(pictures[i])));
  }
}

}  // namespace

JpegMaking jpeg_making(const Image& image) {
  constexpr std::uint8_t kQuantisers = 0xdb;
  constexpr std::size_t kTableBytes = 65, kFrameBytes = 6, kComponentBytes = 3;
  JpegMaking out;
  if (image.format != ImageFormat::kJpeg) return out;
  out.bytes = image.bytes.size();
  for_each_jpeg_segment(image.bytes, [&](std::uint8_t marker, ByteSpan body) {
    if (marker == kQuantisers && out.quality == 0 && body.size() >= kTableBytes && body[0] == 0) {
      SourceLayout::Quantisers steps;
      for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = std::max<std::uint16_t>(body[i + 1], 1);
      out.quality = texmesh::quality_of(steps);
    }
    if (is_jpeg_frame(marker) && body.size() >= kFrameBytes + 3 * kComponentBytes)
      out.subsampling = body[kFrameBytes + 1] == 0x11 ? Subsampling::k444 : Subsampling::k420;
  });
  return out;
}

std::string reason_to_keep(const Mesh& mesh, const std::vector<Material>& materials) {
  bool any = false;
  for (const Material& m : materials) {
    for (const ReadPicture& p : used_textures(m)) {
      any = true;
      if ((p.reference.texcoord == 0 ? mesh.uv0 : mesh.uv1).empty() || p.reference.texcoord > 1)
        return "a texture has no texture coordinates";
      if (p.reference.nearest) return "a texture is not interpolated";
    }
    if (has_directions(m)) return "a material extension has directions in a texture";
  }
  return any ? "" : "it has no textures";
}

MaterialClasses find_classes(const std::vector<Material>& materials, const std::vector<Image>& images) {
  MaterialClasses out;
  for (const Material& m : materials) {
    std::vector<ReadPicture>& pictures = out.pictures.emplace_back();
    Material shared = with_pictures(m, pictures);
    out.class_of.push_back(kNoIndex);
    out.guide.push_back(0);
    if (pictures.empty()) continue;
    shared.name.clear();
    for (std::uint32_t i = 1; i < pictures.size(); ++i) {
      const auto texels = [&](std::uint32_t p) {
        const Image& image = images.at(static_cast<std::size_t>(pictures[p].reference.image));
        return std::uint64_t{image.width_px} * image.height_px;
      };
      if (texels(i) > texels(out.guide.back())) out.guide.back() = i;
    }
    const auto found = std::ranges::find_if(out.classes, [&](const MaterialClass& c) {
      Material other = c.material;
      other.name.clear();
      return other == shared &&
             std::ranges::equal(c.pictures, pictures, {}, &ClassPicture::kind, &ReadPicture::kind);
    });
    out.class_of.back() = static_cast<std::uint32_t>(found - out.classes.begin());
    if (found == out.classes.end()) {
      shared.name = m.name;
      out.classes.push_back({std::move(shared), {}, 0});
      for (const ReadPicture& p : pictures)
        out.classes.back().pictures.push_back({p.kind, 1, kMostHalvings, {1, Subsampling::k420, 0}});
    }
    join_class(out.classes[out.class_of.back()], pictures, out.guide.back(), images);
  }
  return out;
}

std::array<Vec2d, 3> read_uvs(const Mesh& mesh, std::uint32_t triangle, const TextureRef& reference) {
  const std::vector<Vec2f>& uv = reference.texcoord == 1 ? mesh.uv1 : mesh.uv0;
  const UvMatrix matrix = uv_matrix(reference.transform);
  std::array<Vec2d, 3> out;
  for (std::size_t k = 0; k < 3; ++k) out[k] = to_double(matrix.place(uv[mesh.triangles[triangle][k]]));
  return out;
}

}  // namespace texmesh
