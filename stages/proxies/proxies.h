#pragma once
#include "stages/data/fragments.h"
#include "stages/data/nested_scales.h"
#include "stages/data/pixels.h"
#include "stages/data/proxies.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kProxiesVersion = 16;

/// kAuto: only those that look better than what plans show for the same bytes.
enum class ProxyMode : std::uint8_t { kNone, kAuto, kAlways };
template <>
struct EnumNames<ProxyMode> {
  static constexpr std::array<std::string_view, 3> names{"none", "auto", "always"};
};

struct ProxiesOptions {
  ProxyMode mode = ProxyMode::kAuto;
  std::vector<int> sizes{36000, 50000, 150000, 250000, 450000};
  static void fields(auto& s, auto&& v) {
    v("mode", s.mode,
      "whether the whole object also stands in small files: auto = where they look better than what plans show "
      "for the same bytes");
    v("sizes", s.sizes, Range{4000, 2000000}, "bytes of each proxy's file, rising; at most 8");
  }
};

/// The whole object in small files: coarse meshes with atlases of their own, whose textures are baked from
/// S_0 with the source's texels, and behind the smallest one scales with the source's atlas, whichever looks
/// better.
/// - Baked mesh: simplification without regard to the source's charts, one run for all sizes; new charts,
///   packed into one square. Triangles of one class of materials (unlit or lit, single- or double-sided,
///   opaque, mask or blend) become one material. Of meshes of more than 250,000 triangles a scale of about as
///   many stands for S_0.
/// - Baked maps: base colour; occlusion, roughness and metal where they vary; from 100 kB on a normal map
///   where it looks better; emission where something glows. Vertex colours and factors are in the texels.
/// - Normals of baked vertices are there where S_0 is smooth. Where it is not, pictures decide between them
///   and flat triangles.
/// - A scale: its mesh on coarse grids, the source's materials, and its images at sizes and qualities that
///   lose least in lit pictures for the bytes that the mesh leaves; see whole_scale.cpp. Clients count
///   a proxy's textures as four squares of its longest side, so a scale of which all textures together are
///   larger is none.
/// - File: GLB with images inside: WebP where it is baked, else JPEG, and WebP where there is alpha. The
///   smallest one, which clients show before they have a decoder, is baked and coded by
///   EXT_meshopt_compression, KHR_mesh_quantization and KHR_texture_transform, larger ones by
///   KHR_draco_mesh_compression. A file is at most 2 % larger than its size asks for. So the default's
///   smallest one lies with a manifest of 8 kB in the 45,056 bytes of a client's first request.
/// - Losses: FLIP of lit pictures beside S_0's (stages/render in the studio's light) at four displayed
///   heights, where the height is that of the bounding box's longest side; four views, at 512 px two, at
///   1,024 px one. All rows are looked at at 256 px, which choices go by, half at 128 and 512 px, a quarter
///   at 1,024 px.
/// - Automatic choice, each size by itself: a baked one is left out where plans show something better for the
///   bytes. The smallest one is compared with scales of 55 % of its bytes, in which Draco codes as much, and
///   it stays where a larger one does, which clients cannot show at once. Where it wins, larger ones are
///   compared with what plans pay for scales: tables, the coarsest mesh, texels as their coding leaves them.
///   A small size is not tried where the likeliest scale is farther ahead of the last size than baked proxies
///   come by their bytes. Where a file of a scale fits, the nearer of both stays, but where it is less than a
///   tenth nearer than the proxy before it. All proxies take at most 40 % of the source, of its images' files
///   and of S_0's mesh, coded. A source of which the smallest size is more than 15 % gets none: it is loaded
///   soon.
/// Sizes that get no proxy have a note that says why; no model fails because of its proxies. `pixels` are
/// fill_planes()'s. Same bytes for any thread count and machine.
Proxies make_proxies(const NestedScales& scales, const std::vector<Material>& materials,
                     const std::vector<Image>& images, const Fragments& fragments,
                     const std::vector<Pixels>& pixels, const ProxiesOptions& options,
                     const RunContext& context);

}  // namespace texmesh
