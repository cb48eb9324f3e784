#pragma once
// Inside the room only: which materials can have one atlas; where its charts lie; its texels.
#include "stages/charts/charts.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/pixels.h"

namespace texmesh {

enum class TexelKind : std::uint8_t { kColour, kNormal, kNumbers };

/// A picture that a material reads: an image, how it is placed, and as what.
struct ReadPicture {
  TextureRef reference;
  TexelKind kind = TexelKind::kNumbers;
  float normal_scale = 1;
  bool alpha = false;  // its alpha channel is read
};

/// How images were coded, where they are JPEGs.
struct JpegMaking {
  int quality = 0;  // IJG's scale, 1..100; 0: it is none
  Subsampling subsampling = Subsampling::k420;
  std::size_t bytes = 0;
};
JpegMaking jpeg_making(const Image& image);

/// What the members of a class have in common.
struct ClassPicture {
  TexelKind kind = TexelKind::kNumbers;
  std::uint32_t channels = 1;  // 1, 3 or 4
  std::uint32_t halvings = 0;  // its side is the page's by 2^halvings
  JpegMaking jpeg;             // of all its images: the finest, and their bytes
};

/// Materials that differ in name and images alone.
struct MaterialClass {
  Material material;  // references name pictures where materials name images
  std::vector<ClassPicture> pictures;
  double texels = 0;  // of the largest images of its members
};

struct MaterialClasses {
  std::vector<MaterialClass> classes;
  std::vector<std::uint32_t> class_of;             // per material; kNoIndex: it has no texture
  std::vector<std::vector<ReadPicture>> pictures;  // per material, as its class counts them
  std::vector<std::uint32_t> guide;                // per material: its picture of most texels
};

/// Why a model keeps its atlas; empty: nothing speaks against another one.
std::string reason_to_keep(const Mesh& mesh, const std::vector<Material>& materials);

/// Of materials that reason_to_keep() has nothing against.
MaterialClasses find_classes(const std::vector<Material>& materials, const std::vector<Image>& images);

/// A texture's worth of charts.
struct AtlasPage {
  std::uint32_t material_class = 0;
  std::uint32_t side_px = 0;             // a multiple of 64
  std::vector<std::uint32_t> triangles;  // of the mesh, rising
};

/// Where a mesh's textured triangles lie in pages. Triangles without area lie in their neighbours' charts.
struct AtlasPages {
  std::vector<AtlasPage> pages;
  std::vector<Vec2f> uvs;                // per vertex, 0..1 in its page
  std::vector<std::uint32_t> vertex_of;  // per corner 3 t + k; kNoIndex: of no page
  std::vector<std::uint32_t> page_of;    // per triangle; kNoIndex: none
  std::uint32_t chart_count = 0;
  // Of the texels that a class shows: a texel that two places show counts twice, and no page has room for
  // textures that repeat often.
  double least_share = 1;
};

/// Nothing where the pages cannot hold the charts. `most_side_px` is a multiple of 64.
inline constexpr std::uint32_t kMostSidePx = 8192;
std::optional<AtlasPages> place_charts(const ConditionedMesh& mesh, const MaterialClasses& classes,
                                       const std::vector<Image>& images, double density,
                                       const RunContext& context, std::uint32_t most_side_px = kMostSidePx);

/// The texels of one picture of a page. Texels within two of a chart continue it; blocks of 16 x 16 have one
/// colour where there is no chart.
Pixels bake_picture(const Mesh& source, const MaterialClasses& classes, const std::vector<Image>& images,
                    const AtlasPages& pages, std::uint32_t page, std::uint32_t picture,
                    const RunContext& context);

/// A triangle's texture coordinates as a picture is read, its transform included.
std::array<Vec2d, 3> read_uvs(const Mesh& mesh, std::uint32_t triangle, const TextureRef& reference);

}  // namespace texmesh
