#include "stages/fragmentation/fragmentation.h"

#include <bit>

#include "format/model/material_extensions.h"
#include "stages/base/parallel.h"
#include "stages/fragmentation/fragment_grid.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/geometry/texel_coverage.h"

namespace texmesh {
namespace {

/// One way in which an image is sampled.
struct Use {
  std::uint32_t material;
  TextureRef ref;  // without the image
  friend bool operator==(const Use&, const Use&) = default;
};

/// What has to be measured: planes with the same size and uses share it.
struct Job {
  std::uint32_t width_px, height_px;
  std::vector<Use> uses;
};

/// Triangles that sample an image and cannot be placed on it.
struct TriangleFaults {
  std::uint64_t broken_triangles = 0;  // of texture coordinates that are not finite
  bool missing_uvs = false;            // a material has triangles without texture coordinates
};

struct Measure {
  FragmentGrid grid;
  std::vector<std::uint8_t> coverage;
  std::vector<double> surface;          // absolute, per fragment
  std::vector<std::uint32_t> features;  // [scale * fragments + fragment]
  TriangleFaults faults;
};

void check(const ConditionedMesh& conditioned, const std::vector<Material>& materials,
           const ScaleMap& scale_map) {
  const Mesh& mesh = conditioned.mesh;
  const auto fail = [](std::string place, std::size_t expected, std::size_t found) {
    throw StageError("fragmentation", std::move(place), std::to_string(expected), std::to_string(found));
  };
  if (scale_map.crossing.size() != mesh.positions.size())
    fail("scale map: positions", mesh.positions.size(), scale_map.crossing.size());
  for (std::uint8_t p : scale_map.crossing)
    if (p > scale_map.scales) fail("scale map: highest scale", static_cast<std::size_t>(scale_map.scales), p);
  if (mesh.triangle_material.size() != mesh.triangles.size())
    fail("triangle materials", mesh.triangles.size(), mesh.triangle_material.size());
  for (std::uint16_t m : mesh.triangle_material)
    if (m >= materials.size()) fail("triangle material: fewer than", materials.size(), m);
}

/// One texture of a material: what it is for, and which channels of it are read.
struct Slot {
  const TextureRef* ref;
  TextureRole role;
  TextureChannels channels;
};

TextureRole role_of(const ExtensionTextureKind& kind) {
  if (kind.colour) return TextureRole::kColour;
  return kind.key.ends_with("NormalTexture") ? TextureRole::kNormal : TextureRole::kData;
}

std::vector<Slot> slots_of(const Material& m) {
  const TextureChannels base =
      m.alpha_mode == AlphaMode::kOpaque ? TextureChannels::kColour : TextureChannels::kBoth;
  std::vector<Slot> slots{
      {&m.base_colour_texture, TextureRole::kBaseColour, base},
      {&m.emissive_texture, TextureRole::kEmissive, TextureChannels::kColour},
      {&m.normal_texture, TextureRole::kNormal, TextureChannels::kColour},
      {&m.metallic_roughness_texture, TextureRole::kOcclusionRoughnessMetallic, TextureChannels::kColour},
      {&m.occlusion_texture, TextureRole::kOcclusionRoughnessMetallic, TextureChannels::kColour}};
  for (const MaterialExtension& e : m.extensions) {
    const MaterialExtensionKind* kind = find_material_extension(e.name);
    for (const ExtensionTexture& t : e.textures)
      if (const ExtensionTextureKind* k = kind ? kind->texture(t.key) : nullptr)
        slots.push_back({&t.texture, role_of(*k), k->channels});
  }
  return slots;
}

/// The role that names a plane with several: what is seen most, colours before data.
constexpr TextureRole kFirstOfRoles[] = {TextureRole::kBaseColour,
                                         TextureRole::kEmissive,
                                         TextureRole::kColour,
                                         TextureRole::kNormal,
                                         TextureRole::kOcclusionRoughnessMetallic,
                                         TextureRole::kData};

void add_use(std::vector<Use>& uses, std::size_t material, TextureRef ref) {
  ref.image = 0;
  ref.nearest = false;  // makes no difference to what may be touched
  const Use use{static_cast<std::uint32_t>(material), ref};
  if (std::find(uses.begin(), uses.end(), use) == uses.end()) uses.push_back(use);
}

/// The planes that materials ask for, without measures, and for each its uses.
void list_planes(const std::vector<Material>& materials, const std::vector<Image>& images, Fragments& out,
                 std::vector<std::vector<Use>>& uses) {
  for (std::size_t image = 0; image < images.size(); ++image) {
    std::vector<Use> colour, alpha;
    bool role_used[EnumNames<TextureRole>::names.size()] = {};
    for (std::size_t m = 0; m < materials.size(); ++m)
      for (const Slot& slot : slots_of(materials[m])) {
        if (slot.ref->image != static_cast<std::int32_t>(image)) continue;
        role_used[static_cast<int>(slot.role)] = true;
        // A number in alpha uses the colours as well, since both are one file.
        add_use(colour, m, *slot.ref);
        if (slot.channels != TextureChannels::kColour) add_use(alpha, m, *slot.ref);
      }
    if (colour.empty()) continue;
    TexturePlane plane;
    plane.image = static_cast<std::uint32_t>(image);
    plane.channels = images[image].channels >= 3 ? 3 : 1;
    plane.role = *std::find_if(std::begin(kFirstOfRoles), std::end(kFirstOfRoles),
                               [&](TextureRole r) { return role_used[static_cast<int>(r)]; });
    std::string others;
    for (const TextureRole role : kFirstOfRoles)
      if (role != plane.role && role_used[static_cast<int>(role)])
        others += (others.empty() ? "" : ", ") + std::string(enum_name(role));
    if (!others.empty())
      add_info(out.notes, "image-with-several-roles", images[image].name,
               "coded as " + std::string(enum_name(plane.role)) + ", used as " + others + " too");
    out.planes.push_back(plane);
    uses.push_back(colour);
    if (alpha.empty() || images[image].channels % 2 != 0) continue;
    plane.role = TextureRole::kAlpha;
    plane.channels = 1;
    out.planes.push_back(plane);
    uses.push_back(alpha);
  }
}

std::uint32_t mip_side(std::uint32_t side_px, std::uint32_t mip) {
  return static_cast<std::uint32_t>((std::uint64_t{side_px} + (1u << mip) - 1) >> mip);
}

/// Appends the mips of all planes there are, and their uses.
void list_mips(const std::vector<Image>& images, Fragments& out, std::vector<std::vector<Use>>& uses) {
  constexpr std::uint32_t kMaxMip = 3, kLeastSidePx = 128;
  constexpr std::uint64_t kPreviewTexels = 32768;  // of 1/8: what 16 KB hold at quality 60, whatever it shows
  const std::size_t full = out.planes.size();
  for (std::size_t base = 0; base < full; ++base) {
    const Image& image = images[out.planes[base].image];
    for (std::uint32_t mip = 1; mip <= kMaxMip; ++mip) {
      const std::uint32_t w = mip_side(image.width_px, mip), h = mip_side(image.height_px, mip);
      if (std::max(w, h) < kLeastSidePx || (mip == kMaxMip && std::uint64_t{w} * h <= kPreviewTexels)) break;
      TexturePlane plane = out.planes[base];
      plane.mip = mip;
      plane.base = static_cast<std::uint32_t>(base);
      out.planes.push_back(std::move(plane));
      uses.push_back(uses[base]);
    }
  }
}

double area_in_space(const Mesh& mesh, std::size_t triangle) {
  const auto [a, b, c] = corner_points(mesh, mesh.triangles[triangle]);
  const double area = length(cross(b - a, c - a)) / 2;
  return std::isfinite(area) ? area : 0;
}

/// Calls body(triangle, use, whether it is the first use of that material, corners in texels) for the
/// triangles of every use, and returns what it had to leave out.
TriangleFaults for_each_triangle(const Mesh& mesh, const Job& job, const auto& body) {
  TriangleFaults faults;
  for (std::size_t u = 0; u < job.uses.size(); ++u) {
    const Use& use = job.uses[u];
    const std::vector<Vec2f>& uvs = use.ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
    const bool first = std::none_of(job.uses.begin(), job.uses.begin() + static_cast<std::ptrdiff_t>(u),
                                    [&](const Use& earlier) { return earlier.material == use.material; });
    const TexelMap map(use.ref.transform, job.width_px, job.height_px);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (mesh.triangle_material[t] != use.material) continue;
      if (uvs.empty()) {
        faults.missing_uvs = true;
        break;
      }
      std::array<Vec2d, 3> texels;
      bool finite = true;
      for (std::size_t c = 0; c < 3; ++c) {
        texels[c] = map(uvs[mesh.triangles[t][c]]);
        finite = finite && std::isfinite(texels[c].x) && std::isfinite(texels[c].y);
      }
      if (finite)
        body(t, use, first, texels);
      else
        ++faults.broken_triangles;
    }
  }
  return faults;
}

/// (position, fragment) of every corner, each pair once, then f_i.
std::vector<std::uint32_t> count_features(std::vector<std::uint64_t>& corners, const ScaleMap& scale_map,
                                          std::size_t fragments) {
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  std::vector<std::uint32_t> features((static_cast<std::size_t>(scale_map.scales) + 1) * fragments);
  for (std::uint64_t corner : corners) {
    const std::uint64_t position = corner >> 16, fragment = corner & 0xffff;
    ++features[scale_map.crossing[position] * fragments + fragment];
  }
  // So far a position stands at its own highest scale only; it is a feature at every lower one too.
  for (std::size_t k = features.size() - fragments; k-- > 0;) features[k] += features[k + fragments];
  return features;
}

void measure_coverage(const Mesh& mesh, const Job& job, Measure& out) {
  TexelCoverage coverage(job.width_px, job.height_px, Wrap::kRepeat, Wrap::kRepeat);
  out.faults = for_each_triangle(mesh, job,
                                 [&](std::size_t, const Use& use, bool, const std::array<Vec2d, 3>& texels) {
                                   coverage.set_wrap(use.ref.wrap_s, use.ref.wrap_t);
                                   coverage.add(texels);
                                 });
  out.coverage = coverage.release_bits();
}

/// Surface and features of the grid's fragments.
void measure_fragments(const ConditionedMesh& conditioned, const ScaleMap& scale_map, const Job& job,
                       Measure& out) {
  const Mesh& mesh = conditioned.mesh;
  const std::size_t fragments = std::size_t{out.grid.columns} * out.grid.rows;
  out.surface.resize(fragments);
  AreaSpreader spreader(out.grid);
  std::vector<std::uint64_t> corners;
  std::vector<std::uint32_t> last_fragment(mesh.positions.size(), kNoIndex);  // spares most of the sorting
  for_each_triangle(
      mesh, job, [&](std::size_t t, const Use& use, bool first, const std::array<Vec2d, 3>& texels) {
        if (first) spreader.add(texels, use.ref.wrap_s, use.ref.wrap_t, area_in_space(mesh, t), out.surface);
        const Vec2d centre = (texels[0] + texels[1] + texels[2]) * (1.0 / 3);
        for (int c = 0; c < 3; ++c) {
          std::uint32_t position = mesh.position_of(static_cast<std::uint32_t>(t), c);
          if (!conditioned.twin.empty()) position = conditioned.twin[position];
          const Vec2d corner = texels[static_cast<std::size_t>(c)];
          // Decides on which side of a border the corner lies.
          const Vec2d inside = corner + (centre - corner) * 1e-6;
          const std::uint32_t fragment = fragment_at(out.grid, inside, use.ref.wrap_s, use.ref.wrap_t);
          if (last_fragment[position] == fragment) continue;
          last_fragment[position] = fragment;
          corners.push_back(std::uint64_t{position} << 16 | fragment);
        }
      });
  out.features = count_features(corners, scale_map, fragments);
}

Measure measure(const ConditionedMesh& conditioned, const ScaleMap& scale_map, const Job& job,
                const FragmentationOptions& options) {
  Measure out;
  measure_coverage(conditioned.mesh, job, out);
  out.grid = choose_grid(job.width_px, job.height_px, out.coverage,
                         static_cast<std::uint32_t>(options.max_fragments),
                         static_cast<std::uint32_t>(options.min_fragment_px));
  measure_fragments(conditioned, scale_map, job, out);
  return out;
}

std::vector<std::uint32_t> count_covered(const TexturePlane& plane) {
  std::vector<std::uint32_t> out(plane.fragment_count());
  const CoverageMask mask(plane);
  for (std::uint32_t y = 0; y < plane.height_px; ++y) {
    std::uint32_t* row = out.data() + std::size_t{y / plane.fragment_height_px} * plane.columns;
    for (std::uint32_t x = 0; x < plane.width_px; x += 8)  // fragment sides are multiples of 8
      row[x / plane.fragment_width_px] += static_cast<std::uint32_t>(std::popcount(mask.byte_at(x, y)));
  }
  return out;
}

std::vector<float> eta_of_features(const TexturePlane& plane) {
  const std::size_t fragments = plane.fragment_count();
  std::vector<float> eta(plane.features.size());
  for (std::size_t base = 0; base < plane.features.size(); base += fragments) {
    std::uint32_t lo = 0xffffffff, hi = 0;
    for (std::size_t f = 0; f < fragments; ++f)
      if (plane.covered_texels[f] > 0) {
        lo = std::min(lo, plane.features[base + f]);
        hi = std::max(hi, plane.features[base + f]);
      }
    for (std::size_t f = 0; f < fragments && hi > lo; ++f)
      if (plane.covered_texels[f] > 0)
        eta[base + f] = static_cast<float>(static_cast<double>(plane.features[base + f] - lo) / (hi - lo));
  }
  return eta;
}

void complete_plane(const Measure& measured, double whole_surface, TexturePlane& plane) {
  const FragmentGrid& grid = measured.grid;
  plane.width_px = grid.width_px;
  plane.height_px = grid.height_px;
  plane.fragment_width_px = grid.fragment_width_px;
  plane.fragment_height_px = grid.fragment_height_px;
  plane.columns = grid.columns;
  plane.rows = grid.rows;
  plane.grid_reason = grid.reason;
  plane.coverage = measured.coverage;
  plane.covered_texels = count_covered(plane);
  for (double area : measured.surface)
    plane.surface_fraction.push_back(whole_surface > 0 ? static_cast<float>(area / whole_surface) : 0.0f);
  plane.features = measured.features;
  plane.eta = eta_of_features(plane);
}

void note_faults(const TexturePlane& plane, const Measure& measured, const std::string& image, Notes& notes) {
  if (plane.role == TextureRole::kAlpha || plane.mip > 0) return;  // noted for the full-size colours
  if (measured.faults.missing_uvs)
    add_warning(notes, "missing-texture-coordinates", image,
                "a material uses the image without texture coordinates");
  if (measured.faults.broken_triangles > 0)
    add_warning(notes, "non-finite-texture-coordinate", image,
                std::to_string(measured.faults.broken_triangles) +
                    " triangles sample it at coordinates that are not finite");
  if (std::all_of(plane.covered_texels.begin(), plane.covered_texels.end(), [](auto n) { return n == 0; }))
    add_info(notes, "unused-image", image, "no triangle samples the image");
}

}  // namespace

Fragments fragment_textures(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                            const std::vector<Image>& images, const ScaleMap& scale_map,
                            const FragmentationOptions& options, const RunContext& context) {
  check(mesh, materials, scale_map);
  Fragments out;
  out.scales = scale_map.scales;
  std::vector<std::vector<Use>> uses;
  list_planes(materials, images, out, uses);
  if (options.mips) list_mips(images, out, uses);

  std::vector<Job> jobs;
  std::vector<std::size_t> job_of(out.planes.size());
  for (std::size_t p = 0; p < out.planes.size(); ++p) {
    const Image& image = images[out.planes[p].image];
    const std::uint32_t width_px = mip_side(image.width_px, out.planes[p].mip);
    const std::uint32_t height_px = mip_side(image.height_px, out.planes[p].mip);
    const auto same = std::find_if(jobs.begin(), jobs.end(), [&](const Job& job) {
      return job.width_px == width_px && job.height_px == height_px && job.uses == uses[p];
    });
    job_of[p] = static_cast<std::size_t>(same - jobs.begin());
    if (same != jobs.end()) continue;
    jobs.push_back({width_px, height_px, uses[p]});
  }
  std::vector<Measure> measured(jobs.size());
  parallel_each(context, jobs.size(), 1,
                [&](std::size_t j) { measured[j] = measure(mesh, scale_map, jobs[j], options); });
  context.report(0.9);

  double whole_surface = 0;
  for (std::size_t t = 0; t < mesh.mesh.triangles.size(); ++t) whole_surface += area_in_space(mesh.mesh, t);
  for (std::size_t p = 0; p < out.planes.size(); ++p) {
    complete_plane(measured[job_of[p]], whole_surface, out.planes[p]);
    note_faults(out.planes[p], measured[job_of[p]], images[out.planes[p].image].name, out.notes);
  }
  return out;
}

}  // namespace texmesh
