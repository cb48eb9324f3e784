#pragma once

#include "format/documents/about.h"
#include "stages/gltf/check_glb.h"
#include "stages/gltf/draco_mesh.h"
#include "stages/scales/scales.h"
#include "tools/extract/glb/image_codecs.h"

namespace texmesh {

/// A scale's GLB taken apart, changed and written again: other images, a coarser mesh, further levels of
/// detail. Materials, nodes, names, extras and extensions stay as they are.
class StandaloneGlb {
 public:
  /// Checks the whole file first (check_glb.h), by the rules of a package's meshes; those of a standalone
  /// file are a proxy's. `entry` is for messages. FormatError.
  StandaloneGlb(std::span<const std::uint8_t> glb, std::string entry, GlbRules rules = GlbRules::kPackage);
  StandaloneGlb(const StandaloneGlb& other);
  StandaloneGlb(StandaloneGlb&& other) noexcept;
  StandaloneGlb& operator=(const StandaloneGlb&) = delete;
  StandaloneGlb& operator=(StandaloneGlb&& other) noexcept;
  ~StandaloneGlb();

  /// Source images that the file's images stand for ("texture/<number>"), in the file's order.
  std::vector<std::uint32_t> source_images() const;
  /// Of these the images that are within the file.
  std::map<std::uint32_t, FileImageData> images() const;
  /// How the file codes its meshes.
  MeshCodec codec() const;
  /// Replaces the file's images by those of the same source image; images that are not given stay. WebP
  /// makes EXT_texture_webp a required extension.
  void set_images(const std::map<std::uint32_t, FileImageData>& images);
  /// Takes the meshes of another file of the same package, whose node k is this file's node k, for its own.
  void take_meshes(StandaloneGlb other);
  /// Codes Draco streams anew, see recode_draco(); other codecs stay as they are.
  void recode(const DracoSteps& steps, const NormalSamples* lit_as, const RunContext& context);
  bool has_draco() const;

  /// Makes the nodes of the scene the children of one node, the first level of detail.
  /// Once, before add_level().
  void begin_levels(double screen_coverage);
  /// Adds a coarser file of the same package as a further level (MSFT_lod), whose materials and images are
  /// those already here. Levels by falling `screen_coverage`: the share of the screen's area above which the
  /// level is shown (extras.MSFT_screencoverage).
  void add_level(StandaloneGlb coarser, double screen_coverage);

  /// Makes the nodes of the scene the children of one node that moves them by `translation`, object units,
  /// and then makes all lengths `scale` times as long. Positions stay as they are. Nothing happens for {0, 0,
  /// 0} and 1. After all levels of detail.
  void move_to(Vec3d translation, double scale = 1);

  /// What finish() writes of the object: asset.copyright, asset.extras, KHR_xmp_json_ld (write_gltf_about()).
  void set_about(const About& about);

  /// The file; views in their first order, those that nothing uses left out. Same input, same bytes.
  std::vector<std::uint8_t> finish() const;

 private:
  struct Document;
  std::size_t add_view(std::vector<std::uint8_t> bytes);
  /// Appends views, accessors and meshes; gives the index of the first mesh.
  std::size_t append_meshes(StandaloneGlb& other);
  void use_extension(const std::string& name, bool required);
  std::string entry_;
  std::shared_ptr<const About> about_;
  std::unique_ptr<Document> document_;
  std::uint64_t fallback_bytes_ = 0;
  std::size_t level_node_ = 0;
};

}  // namespace texmesh
