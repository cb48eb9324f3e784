#pragma once

#include "format/documents/annotations.h"
#include "format/rules/output_transform.h"
#include "stages/gltf/check_glb.h"
#include "stages/gltf/draco_mesh.h"
#include "stages/gltf/glb_container.h"
#include "stages/scales/scales.h"
#include "tools/extract/glb/texture_source.h"

namespace texmesh {

/// A scale's GLB taken apart, changed and written again: other images, a coarser mesh, further levels of
/// detail. Materials, nodes, names, extras and extensions stay as they are.
class StandaloneGlb {
 public:
  /// Checks the whole file first (check_glb.h), by the rules of a package's meshes; those of a standalone
  /// file are a proxy's. Without rules nothing is checked: of files that were just written, which takes
  /// decoding them. `entry` is for messages. FormatError.
  StandaloneGlb(std::span<const std::uint8_t> glb, std::string entry,
                std::optional<GlbRules> rules = GlbRules::kPackage);

  /// Source images that the file's images stand for ("texture/<number>"), in the file's order.
  std::vector<std::uint32_t> source_images() const;
  /// Of these the images that are within the file.
  std::map<std::uint32_t, FileImageData> images() const;
  /// Per material: the set of texture coordinates along which meshes have tangents (make_tangents()); -1 for
  /// materials without textures in tangent space, and for all where no mesh of the file has tangents.
  std::vector<int> tangent_texcoords() const;
  /// How the file codes its meshes.
  MeshCodec codec() const;
  /// Replaces the file's images by those of the same source image; images that are not given stay. WebP
  /// and AVIF make EXT_texture_webp and EXT_texture_avif required extensions.
  void set_images(const std::map<std::uint32_t, FileImageData>& images);
  /// Takes the meshes of another file of the same package, whose node k is this file's node k, for its own.
  void take_meshes(StandaloneGlb other);
  /// The Draco streams of the meshes; none of other codecs.
  std::vector<DracoStream> draco_streams() const;
  /// Takes as many streams for its own; those without vertices are the file's.
  void set_draco_streams(std::vector<DracoStream> streams);
  bool has_draco() const { return codec() == MeshCodec::kDraco; }

  /// Makes the nodes of the scene the children of one node, the first level of detail.
  /// Once, before add_level().
  void begin_levels(double screen_coverage);
  /// Adds a coarser file of the same package as a further level (MSFT_lod), whose materials and images are
  /// those already here. Levels by falling `screen_coverage`: the share of the screen's area above which the
  /// level is shown (extras.MSFT_screencoverage).
  void add_level(StandaloneGlb coarser, double screen_coverage);

  /// Makes the nodes of the scene the children of one node that places them. Positions stay as they are.
  /// Nothing happens where the transform changes nothing. After all levels of detail.
  void place(const OutputTransform& transform);

  /// What finish() writes of the object: asset.copyright, asset.extras, KHR_xmp_json_ld (write_gltf_about()).
  void set_about(const About& about);

  /// The file; views in their first order, those that nothing uses left out. Same input, same bytes.
  std::vector<std::uint8_t> finish() const;

 private:
  struct View {
    nlohmann::ordered_json json;  // without buffer, byteOffset, byteLength, except those of a fallback buffer
    std::vector<std::uint8_t> bytes;
    bool meshopt = false;
  };
  std::size_t add_view(std::vector<std::uint8_t> bytes);
  /// Appends views, accessors and meshes; gives the index of the first mesh.
  std::size_t append_meshes(StandaloneGlb& other);
  void use_extension(const std::string& name, bool required);
  std::string entry_;
  std::shared_ptr<const About> about_;
  nlohmann::ordered_json root_;
  std::vector<View> views_;
  std::uint64_t fallback_bytes_ = 0;
  std::size_t level_node_ = 0;
};

/// What a file of at most `bytes` says of the object before its picture is chosen: all of it where that takes
/// a twentieth of the bytes, else less (about_choices()). What is left over after the picture takes the rest
/// (add_words()).
About reserved_about(const About& about, const OutputTransform& transform, std::uint64_t bytes);
/// Puts the most words about the object into a finished file that `bytes` hold. False where some do not fit.
bool add_words(std::vector<std::uint8_t>& glb, const About& about, std::uint64_t bytes);

/// The notes of a package in the coordinates of a file that was placed so, as JSON; an empty list without
/// any.
nlohmann::ordered_json placed_notes(const Annotations& annotations, const OutputTransform& place);
/// Puts them into a finished file: extras.texmesh.annotations of the root (SPEC.md, A.9).
void add_notes(std::vector<std::uint8_t>& glb, nlohmann::ordered_json notes);

/// The normals of a scale that the vertex-split stream alone has. kFitted: so that it is lit as S_0 is, which
/// takes the whole stream. kStreamed: S_0's, as the stream's prefix of the scale has them. kHasty: the same
/// in a mesh that is hardly compressed, to be coded again.
enum class StreamedNormals : std::uint8_t { kFitted, kStreamed, kHasty };

/// A scale as one file with the previews in it, wherever the package has the scale. A scale of the stream
/// gets materials, images and node names of the coarsest scale's GLB, that file's mesh codec, and where it
/// has tangents those of make_tangents(). InputError
/// for a scale that is not there; FormatError when the package is damaged. Same result for any thread count.
StandaloneGlb scale_file(PackageReader& package, int scale, const RunContext& context,
                         StreamedNormals normals = StreamedNormals::kFitted);

/// The mesh and materials of a file. Its images become single texels, all different (import makes equal ones
/// one), named by image_name() of their source image.
Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context);

/// As import names "texture/<image>": without the folder.
std::string image_name(std::uint32_t image);

/// The bytes of an image that is within a GLB.
Bytes image_bytes(const GlbParts& parts, const nlohmann::ordered_json& image);
/// Appends bytes to the binary chunk; gives the index of their view.
std::size_t add_view(GlbParts& to, const Bytes& bytes);

/// Multiplies the mesh's texture coordinates by the scale that KHR_texture_transform gives all textures of
/// the materials, and takes the extension out of the document, whose `mesh` this is. False, and nothing
/// changes, where textures differ, or where there is more than a scale.
bool bake_texture_scale(nlohmann::ordered_json& root, Mesh& mesh);

/// The same model for programs that know glTF 2.0 and no extension of it that compresses: floats instead of
/// KHR_draco_mesh_compression, EXT_meshopt_compression and KHR_mesh_quantization, PNG instead of WebP,
/// no KHR_texture_transform where it is one scale. Parts, materials and tangents stay; the feature ids of
/// merged parts go. Of a file without levels of detail and before place(). Same bytes for any thread count.
StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context);

}  // namespace texmesh
