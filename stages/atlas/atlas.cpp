#include "stages/atlas/atlas.h"

#include "format/base/bytes.h"
#include "stages/atlas/atlas_parts.h"
#include "stages/base/first_use_table.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/png_writer.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

constexpr int kLeastQuality = 75, kMostQuality = 97;  // of a JPEG
constexpr double kSharpEnough = 0.5;                  // of the source's texels
constexpr int kPngLevel = 1;                          // the files are read once, by the stages that follow

ChartedModel kept(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                  const std::vector<Image>& images, const std::string& reason) {
  ChartedModel out{mesh, materials, images, {}};
  if (!reason.empty()) add_info(out.notes, kKeptAtlasNote, "", "the source's atlas is kept: " + reason);
  return out;
}

/// The mesh with the pages' texture coordinates. Wedges stand in the order of their first use.
ConditionedMesh mesh_on_pages(const ConditionedMesh& from, const AtlasPages& pages) {
  const Mesh& old = from.mesh;
  ConditionedMesh out = from;
  Mesh& mesh = out.mesh;
  mesh.uv0.clear(), mesh.uv1.clear(), mesh.tangents.clear();
  std::vector<std::uint32_t> itself(old.positions.size());
  for (std::uint32_t p = 0; p < itself.size(); ++p) itself[p] = p;
  const std::vector<std::uint32_t> alike = weld_wedges(mesh, itself);
  mesh.wedge_position.clear(), mesh.normals.clear(), mesh.colours.clear();
  struct Wedge {
    std::uint32_t old, vertex;
  };
  std::vector<Wedge> wedges;
  FirstUseTable table(old.wedge_count());
  const auto hash = [](Wedge w) { return hash_with(hash_with(0, w.old), w.vertex); };
  for (std::uint32_t c = 0; c < 3 * old.triangles.size(); ++c) {
    const Wedge wanted{alike[old.triangles[c / 3][c % 3]], pages.vertex_of[c]};
    const std::uint32_t number = table.number_of(
        hash(wanted),
        [&](std::uint32_t n) { return wedges[n].old == wanted.old && wedges[n].vertex == wanted.vertex; },
        [&](std::uint32_t n) { return hash(wedges[n]); });
    if (number == wedges.size()) wedges.push_back(wanted);
    mesh.triangles[c / 3][c % 3] = number;
  }
  for (const Wedge& w : wedges) {
    mesh.wedge_position.push_back(old.wedge_position[w.old]);
    if (!old.normals.empty()) mesh.normals.push_back(old.normals[w.old]);
    if (!old.colours.empty()) mesh.colours.push_back(old.colours[w.old]);
    mesh.uv0.push_back(w.vertex == kNoIndex ? Vec2f{} : pages.uvs[w.vertex]);
  }
  out.uv_sets.clear();
  return out;
}

const char* name_of(TexelKind kind) {
  return kind == TexelKind::kColour ? "colour" : kind == TexelKind::kNormal ? "normal" : "data";
}

/// The best JPEG from the source's quality on that takes no more bytes than the source.
Bytes jpeg_within(const Pixels& pixels, const JpegMaking& source) {
  int least = std::clamp(source.quality, kLeastQuality, kMostQuality), most = kMostQuality;
  Bytes best = encode_jpeg(pixels, least, source.subsampling);
  while (least < most) {
    const int quality = (least + most + 1) / 2;
    Bytes tried = encode_jpeg(pixels, quality, source.subsampling);
    const bool fits = tried.size() <= source.bytes;
    (fits ? least : most) = fits ? quality : quality - 1;
    if (fits) best = std::move(tried);
  }
  return best;
}

/// As the source has it: a JPEG, or a PNG.
Image coded_image(const Pixels& pixels, const JpegMaking& source, std::string name) {
  Image out;
  const bool as_jpeg = source.quality > 0 && pixels.channels != 4;
  out.format = as_jpeg ? ImageFormat::kJpeg : ImageFormat::kPng;
  out.name = std::move(name) + (as_jpeg ? ".jpg" : ".png");
  out.width_px = pixels.width_px, out.height_px = pixels.height_px;
  out.channels = static_cast<std::uint8_t>(pixels.channels);
  out.bits_per_channel = 8;
  out.bytes = as_jpeg ? jpeg_within(pixels, source) : write_png(pixels, {kPngLevel, false});
  return out;
}

/// Materials without textures, then one for each page; the pages' images.
void add_pages(const ConditionedMesh& mesh, const std::vector<Material>& materials,
               const std::vector<Image>& images, const MaterialClasses& classes, const AtlasPages& pages,
               ChartedModel& out, const RunContext& context) {
  std::vector<std::uint16_t> number(materials.size(), 0);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (classes.class_of[m] != kNoIndex) continue;
    number[m] = static_cast<std::uint16_t>(out.materials.size());
    out.materials.push_back(materials[m]);
  }
  const auto first_page = static_cast<std::uint16_t>(out.materials.size());
  for (std::uint32_t p = 0; p < pages.pages.size(); ++p) {
    const MaterialClass& of = classes.classes[pages.pages[p].material_class];
    Material material = of.material;
    const auto first_image = static_cast<std::int32_t>(out.images.size());
    for_each_texture(material, [&](TextureRef& reference) {
      if (reference.used()) reference.image += first_image;
    });
    out.materials.push_back(std::move(material));
    for (std::uint32_t i = 0; i < of.pictures.size(); ++i) {
      context.report(0.3 + 0.7 * (p + double(i) / double(of.pictures.size())) / double(pages.pages.size()));
      out.images.push_back(coded_image(
          bake_picture(mesh.mesh, classes, images, pages, p, i, context), of.pictures[i].jpeg,
          "atlas-" + std::to_string(p) + "-" + std::to_string(i) + "-" + name_of(of.pictures[i].kind)));
    }
  }
  for (std::size_t t = 0; t < mesh.mesh.triangles.size(); ++t) {
    const std::uint16_t material = mesh.mesh.triangle_material[t];
    const std::uint32_t page = pages.page_of[t];
    out.mesh.mesh.triangle_material[t] =
        page == kNoIndex ? number[material] : static_cast<std::uint16_t>(first_page + page);
  }
}

std::string gain_of(std::size_t charts, std::size_t new_charts) {
  const std::string found = "a new atlas has " + std::to_string(new_charts) +
                            (new_charts == 1 ? " chart for " : " charts for ") + std::to_string(charts);
  if (new_charts < charts) return found + "; coarse scales and coordinates take fewer bytes";
  return found + ", so it saves nothing: --atlas keep takes fewer bytes";
}

}  // namespace

ChartedModel chart_model(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                         const std::vector<Image>& images, const AtlasOptions& options,
                         const RunContext& context) {
  if (options.mode != AtlasMode::kRebuild) return kept(mesh, materials, images, "");
  if (const std::string reason = reason_to_keep(mesh.mesh, materials); !reason.empty())
    return kept(mesh, materials, images, reason);
  const std::size_t charts = count_charts(mesh.mesh);
  const MaterialClasses classes = find_classes(materials, images);
  const auto pages = place_charts(mesh, classes, images, options.density, context);
  if (!pages) return kept(mesh, materials, images, "its charts fit no page");
  context.report(0.3);
  ChartedModel out;
  out.mesh = mesh_on_pages(mesh, *pages);
  add_pages(mesh, materials, images, classes, *pages, out, context);
  add_info(out.notes, kRebuiltAtlasNote, "", gain_of(charts, pages->chart_count) + ". " + kLostByRebuilding);
  if (const int percent = static_cast<int>(100 * pages->least_share); pages->least_share < kSharpEnough)
    add_warning(out.notes, "atlas-blurred", "",
                "textures show in several places: the new atlas has " +
                    (percent < 1 ? "less than 1" : "only " + std::to_string(percent)) +
                    " % of the texels that the surface has of them; --atlas keep has all");
  return out;
}

}  // namespace texmesh
