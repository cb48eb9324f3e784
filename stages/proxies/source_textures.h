#pragma once
// Inside the room only: the source's images, smaller and coded anew, and what that costs in pictures.
#include <optional>

#include "stages/render/scale_pictures.h"

namespace texmesh {

/// How an image is coded. Colours: JPEG of YCbCr 4:4:4; numbers: JPEG of channels as they are; with alpha:
/// WebP.
struct CodedTexture {
  const char* mime_type = "image/jpeg";
  Bytes file;
  std::uint32_t width_px = 0, height_px = 0;
};

inline constexpr double kFrameOfImage = 330;  // bytes that a document says of an image

/// What becomes of the images of a group.
struct TexturePlan {
  int steps = 0;     // of the sides: each is 1 / sqrt 2 of the one before
  int quality = 0;   // 1..100
  double bytes = 0;  // of all images of the group
  double loss = 0;   // square of the FLIP that they alone make
};

/// The images that a model's materials read, in groups that are treated alike: each image is one, or of many
/// images all of one use.
class SourceTextures {
 public:
  struct Member {
    std::uint32_t image = 0;            // of the source
    std::vector<std::size_t> textures;  // of the shown materials
  };
  struct Group {
    TextureUse use = TextureUse::kBaseColour;  // of its first reader
    std::vector<Member> members;
  };
  /// `shown` must outlive it. Materials without a triangle in S_0 do not count.
  SourceTextures(const Mesh& finest, const std::vector<Material>& materials, const ShownMaterials& shown);

  const std::vector<Group>& groups() const { return groups_; }
  bool has(std::int32_t image) const;
  /// Whether clients' estimate of a proxy's textures, four squares of the longest side, holds all of them at
  /// these steps, by group.
  bool keep_to_gpu_estimate(const std::vector<int>& steps, double squares = 4) const;
  double texels(const Group& group, int steps) const;
  /// Longest side of an image of the group.
  std::uint32_t side_px(const Group& group, int steps) const;
  /// `quick`: one scan, for comparisons.
  CodedTexture coded(const Member& member, TextureUse use, int steps, int quality, bool quick);
  /// As readers of the file show it.
  RenderTexture shown(const CodedTexture& coded, std::size_t texture, const RunContext& context) const;
  const ShownMaterials& full() const { return shown_; }

 private:
  const Pixels& pixels(const Member& member, TextureUse use, int steps);
  Vec2<std::uint32_t> sides(const Member& member, int steps) const;
  const ShownMaterials& shown_;
  std::vector<Group> groups_;
  std::map<std::pair<std::uint32_t, int>, Pixels> pixels_;  // by image and steps
};

/// For each group the plans that give most for their bytes, found in pictures of S_0 with one group changed
/// at a time. Losses in the same pixels join about as the sum of their squares (tools/extract).
class TextureCurves {
 public:
  /// `most_bytes`: no file takes more.
  TextureCurves(const Mesh& mesh, SourceTextures& textures, const ReferenceViews& views, double most_bytes,
                const RunContext& context);
  struct Dealt {
    std::vector<TexturePlan> plans;  // by group
    double bytes = 0, loss = 0;
  };
  /// The least loss of at most `bytes`; nothing where the smallest files take more.
  std::optional<Dealt> deal(double bytes) const;

 private:
  std::vector<std::vector<TexturePlan>> curves_;  // by group: rising bytes, falling loss, convex
};

}  // namespace texmesh
