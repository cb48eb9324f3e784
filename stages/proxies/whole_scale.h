#pragma once
// Inside the room only: a scale with the source's atlas as a proxy of a number of bytes.
#include "stages/gltf/scale_glb.h"
#include "stages/proxies/make_proxy.h"
#include "stages/proxies/source_textures.h"

namespace texmesh {

/// What files of scales are made from. All must outlive them.
struct WholeScaleSource {
  const NestedScales& scales;
  const std::vector<Material>& materials;
  const std::vector<Image>& images;
  const Mesh& mesh;      // S_0, or the scale that stands for it
  std::size_t stand_in;  // its index; finer ones lose nothing
  const ShownMaterials& shown;
};

/// Files of scales with the source's materials, coordinates and images, which are made smaller and coded
/// anew: meshes by KHR_draco_mesh_compression. What curves and scales lose is measured once, when it is first
/// asked for. Same bytes for any thread count.
class WholeScales {
 public:
  /// `most_bytes`: of the largest file.
  WholeScales(const WholeScaleSource& source, double most_bytes);
  /// The file of about so many bytes, at most kOverAsked times, that is likely to look best, by sums of what
  /// its mesh and its images lose in pictures of kLargePx. Nothing where none fits.
  std::optional<MadeProxy> of(std::uint64_t bytes, const RunContext& context);

 private:
  /// A scale, and how finely it is coded, as an index of kScaleFineness.
  struct MeshChoice {
    std::size_t scale = 0, coding = 0;
    auto operator<=>(const MeshChoice&) const = default;
  };
  struct Choice {
    MeshChoice mesh;
    TextureCurves::Dealt textures;
    double loss = 0;
  };
  void measure(const RunContext& context);
  double flip_of(std::size_t scale, const RunContext& context);
  double loss_of(std::size_t scale, const RunContext& context);
  double mesh_bytes(const MeshChoice& mesh) const;
  double least_loss_of(std::size_t scale) const;
  std::optional<Choice> best_with(std::size_t scale, double bytes, double most_loss,
                                  const RunContext& context);
  std::optional<Choice> choose(double bytes, const RunContext& context);
  const ScaleFrames& frames_of(std::size_t scale, const RunContext& context);
  ScaleCoding coding_of(const MeshChoice& mesh, const RunContext& context);
  void code_mesh_of(const MeshChoice& mesh, const RunContext& context);
  struct CodedImages {
    GlbImages files;
    std::vector<ProxyTexture> rows;
    double bytes = 0;  // with what the document says of them
  };
  CodedImages coded_images(const TextureCurves::Dealt& dealt, int higher, bool quick);
  static int higher_for(const std::function<double(int)>& one_scan, double bytes);
  CodedImages filled(const TextureCurves::Dealt& dealt, double bytes);
  std::optional<MadeProxy> finished(const Choice& choice, std::uint64_t bytes, const RunContext& context);

  const WholeScaleSource source_;
  std::vector<Material> materials_;  // without extensions whose images no core texture reads
  double most_bytes_;
  SourceTextures textures_;
  bool hopeless_;              // more images than clients count
  double scans_share_ = 0.95;  // of the bytes of one scan, what images of several take
  std::optional<ReferenceViews> views_;
  std::optional<TextureCurves> curves_;
  std::map<std::size_t, double> scale_flips_;  // of those looked at, by scale
  std::optional<ScaleCoding> coding_;          // as fine as files for viewers are, without frames
  std::optional<std::pair<std::size_t, ScaleFrames>> frames_;  // of the scale that was last asked for
  std::map<MeshChoice, double> file_bytes_;                    // of files without images
  std::vector<double> estimates_;                              // of meshes' bytes, by scale
  double of_estimate_ = 0;        // what a mesh of the usual coding takes of them
  double document_bytes_ = 1500;  // of a file without images, besides its mesh
};

}  // namespace texmesh
