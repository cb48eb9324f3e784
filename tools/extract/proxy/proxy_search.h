#pragma once

#include "tools/extract/budget/reference.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {

/// A picture of a proxy, by what the first slot that reads it is for.
struct ProxyMap {
  enum class Use : std::uint8_t { kBaseColour, kData, kNormal, kEmission };
  std::optional<Use> use;
  Pixels pixels;  // of 3 or 4 channels
  Averaging averaging() const;
  const char* role() const;  // as reports name it: "base-colour", "metallic-roughness", "normal", "emissive"
};
/// At a share of its sides, 0..1, of at least 4 texels.
Pixels smaller_map(const ProxyMap& map, double share);

/// The mesh, and behind it coarser ones in the same atlas, each with about four fifths of the vertices of the
/// one before, down to a fifth. Fewer where collapses end: charts stay, and borders keep together. Same
/// result for any thread count.
std::vector<Mesh> thinner_meshes(const Mesh& mesh, const RunContext& context);

/// Which maps of a proxy a file keeps.
struct ProxyMapChoice {
  bool data = true;  // occlusion, roughness and metal
  bool normal = true;
  friend bool operator==(const ProxyMapChoice&, const ProxyMapChoice&) = default;
};

/// A proxy taken apart, for files that are smaller: of fewer triangles, its mesh coded coarser, its pictures
/// smaller or of less quality, maps left out.
class ProxyParts {
 public:
  /// Nothing for a proxy that this cannot be done with: of several nodes, with extensions of materials, with
  /// two pictures of one use, or grey ones. Format 2.0 allows these, and texmesh does not write them.
  /// FormatError for a broken file.
  static std::optional<ProxyParts> read(std::span<const std::uint8_t> glb, const std::string& entry,
                                        const RunContext& context);

  bool has(ProxyMap::Use use) const { return map_of(use) != nullptr; }
  double extent() const;  // longest side of the mesh's box, object units; above 0
  /// How many meshes there are to choose from: the proxy's own and, behind it, thinner_meshes().
  std::size_t mesh_count() const { return meshes_.size(); }
  std::uint64_t triangles(std::size_t mesh) const { return meshes_[mesh].triangles.size(); }

  /// One of the meshes as KHR_draco_mesh_compression of these steps. Same bytes for any thread count.
  StandaloneGlb coded(std::size_t mesh, const DracoSteps& steps, const RunContext& context) const;
  /// The proxy with such a mesh and without the maps that are not chosen; image k is "texture/k" and holds
  /// one texel. Without the map of data, roughness and metal are its means.
  StandaloneGlb file(const ProxyMapChoice& choice, const StandaloneGlb& coded) const;
  /// The pictures of such a file, by k. Without the map of data, half of its occlusion is multiplied into the
  /// base colour, as the stage does it.
  std::vector<ProxyMap> maps(const ProxyMapChoice& choice) const;

 private:
  ProxyParts() = default;
  const ProxyMap* map_of(ProxyMap::Use use) const;
  nlohmann::ordered_json materials_of(const ProxyMapChoice& choice) const;
  std::string entry_;
  nlohmann::ordered_json root_;  // of the file, without its mesh
  std::vector<Mesh> meshes_;
  std::vector<ProxyMap> maps_;  // by image of the file
};

/// A proxy as the package has it, moved and described as it is wished. `asked_bytes`: what is known of the
/// object is cut to what a file of so many bytes may say; 0 = nothing is cut. InputError for a proxy that is
/// not there.
Extracted extract_proxy(PackageReader& package, const ExtractProxy& wishes, const OutputTransform& place,
                        const RunContext& context, std::uint64_t asked_bytes = 0);

/// Of proxies as they are, those that were looked at: for searches for other numbers of bytes.
using ProxyDifferences = std::map<std::uint32_t, double>;

/// `found`, a file of a scale for so many bytes, or one of a proxy where that one's whole lit pictures are
/// nearer to the package's best, or where only that one keeps within the bytes. A proxy of too many bytes
/// gets fewer triangles, its mesh coded by Draco, its pictures smaller or coded anew, and maps left out,
/// until it fills the bytes. `found` stays where a scale, levels of detail or PNG is asked for. Same bytes
/// for any thread count.
Extracted or_of_proxy(const Reference& reference, std::uint64_t bytes, ProxyDifferences& differences,
                      Extracted found);

}  // namespace texmesh
