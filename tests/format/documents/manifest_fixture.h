#pragma once
#include <string>

#include "format/container/layout.h"
#include "format/documents/manifest.h"

namespace texmesh::testing {

inline std::span<const std::uint8_t> as_bytes(std::string_view s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

/// A manifest that follows every rule, with `scales` scales and `planes` texture planes; `digits` > 0 makes
/// its numbers as long as they can get.
inline Manifest make_manifest(int scales, std::uint32_t planes, bool long_numbers = false) {
  const std::uint64_t far = long_numbers ? (std::uint64_t{1} << 40) : 64 * 1024;
  Manifest m;
  m.title = long_numbers ? std::string(kMaxTitleBytes, '"') : "A \"fig\" \xc3\xa4";
  m.origin = long_numbers ? Vec3d{-4.9876543212345678e6, 1.2345678912345e-7, -8.7654321098765432e-9}
                          : Vec3d{1, 2, 3};
  m.bounds_min = {-0.12345678901234567, -1.2345678901234567e-5, -9.8765432109876543e-5};
  m.bounds_max = {0.12345678901234567, 1.2345678901234567e-5, 9.8765432109876543e-5};
  m.object_height = 0.24691357802469134;
  m.surface_area = 0.123457;
  m.jnd = 0.1;
  Sha256 digest{};
  digest.fill(0xab);
  for (int k = 0; k < scales; ++k) {
    ManifestScale s;
    s.scale = k;
    s.triangles = static_cast<std::uint32_t>((long_numbers ? 4'000'000'000u : 4000u) - k);
    s.vertices = static_cast<std::uint32_t>((long_numbers ? 2'000'000'000u : 2000u) - k);
    s.glb = {mesh_path(k), far + 64ull * 1000 * static_cast<std::uint64_t>(scales - k),
             (long_numbers ? 4'000'000'000ull : 4000ull) / static_cast<std::uint64_t>(k + 1), digest};
    s.major = k % 3 == 0;
    s.error_max = k == 0 ? 0 : 1.23457e-05;
    s.error_rms = k == 0 ? 0 : 3.45679e-05;
    s.p95 = k == 0 ? 0 : 1.23456e-05;
    s.p99 = k == 0 ? 0 : 2.34567e-05;
    s.display_px_jnd = k == 0 ? kAnyDisplayPx : 12345.6;
    s.display_px_error = k == 0 ? kAnyDisplayPx : 23456.7;
    s.display_px_edge = k == 0 ? kAnyDisplayPx : 1234.56;
    s.display_px_flip = k == 0 ? kAnyDisplayPx : 2345.67;
    m.scales.push_back(s);
  }
  if (scales > 1) m.scales.back().floor = std::string(long_numbers ? kMaxFloorBytes : 20, 'f');
  for (int k = scales - 1; k >= 0; --k)
    m.steps.push_back({k == 0 ? kAnyDisplayPx : 12345.6 + 10 * (scales - k), k});
  m.plane_count = planes;
  static_cast<EntryRef&>(m.index) = {kIndexPath, far, 4000, digest};
  m.index.head_bytes = 60;
  m.index.head_digest = digest;
  m.tables = m.index;
  m.tables.path = kTablesPath;
  m.textures = {kTexturesPath, far, 4000, digest};
  m.quality = {kQualityPath, far, 4000, digest};
  m.provenance = {kProvenancePath, far, 4000, digest};
  m.about = {kAboutPath, far, 4000, digest};
  if (long_numbers) {
    m.proxy_sizes_px = {128.123, 256.123, 512.123};
    for (std::uint32_t k = 0; k < 3; ++k)
      m.proxies.push_back({{proxy_path(k), far, 100'000 + k, digest},
                           60'000,
                           60'000,
                           1024,
                           {0.123456, 0.234567, 0.345678},
                           {0.123456, 0.234567, 0.345678}});
  }
  if (long_numbers) m.poster = PosterRef{{kPosterPath, far, 1'000'000, digest}, 4096, 4096};
  if (long_numbers) m.thesis = EntryRef{kThesisPath, far, 4'000'000, digest};
  if (long_numbers) m.stream = StreamRef{far, 4'000'000'000u, 400'000, digest};
  return m;
}

}  // namespace texmesh::testing
