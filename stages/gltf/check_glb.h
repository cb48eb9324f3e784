#pragma once

#include "format/base/finding.h"
#include "format/base/sha256.h"
#include "format/base/vec.h"

namespace texmesh {

/// What a GLB file really holds, once it has been decoded.
struct GlbFacts {
  std::uint64_t triangles = 0, vertices = 0;  // over all primitives; vertices are counted as stored (wedges)
  std::uint64_t primitives = 0;
  std::vector<std::string> image_names;  // in order; "" where an image has no name
  std::vector<std::string> image_uris;   // in order; "" where an image is within the file
  std::vector<Sha256> image_digests;     // in order; zeros where an image is not
  std::uint32_t largest_image_px = 0;    // longest side of the images within the file; 0 = none
  std::string codec = "none";            // none, quantized, meshopt or draco, as ScalesOptions::mesh_codec
  std::vector<Vec3d> positions;  // all different ones under their nodes' transforms, sorted by x, y, z
  bool has_bounds = false;
  Vec3d bounds_min, bounds_max;  // of the decoded positions under their nodes' transforms
};

/// Whose rules a file keeps: meshes of a package, whose images may be previews by their relative URIs
/// ("../preview/003.jpg"), or files that `texmesh extract` writes, which also may have
/// WebP and AVIF images (EXT_texture_webp, EXT_texture_avif) and levels of detail (MSFT_lod).
enum class GlbRules : std::uint8_t { kPackage, kStandalone };

/// Checks that a GLB is structurally valid glTF 2.0 that stands alone, or with the previews: header and
/// chunks, JSON, every index in range, buffer views and accessors within the binary chunk, Draco and meshopt
/// data that decodes to what the accessors say, indices within the vertices, finite positions, a node tree
/// without cycles, images that decode. The Khronos validator checks more (tests/node); this one needs no
/// JavaScript and also decodes. Adds a finding per fault, with checks "glb-container", "glb-json",
/// "glb-reference", "glb-accessor", "glb-decode", "glb-index", "glb-position", "glb-node", "glb-image". Never
/// throws for what the bytes hold.
GlbFacts check_glb(std::span<const std::uint8_t> bytes, const std::string& entry, Findings& findings,
                   GlbRules rules = GlbRules::kPackage);

}  // namespace texmesh
