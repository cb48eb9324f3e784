#include "stages/scales/scales.h"
#include "format/rules/viewing.h"
#include "format/rules/whole_textures.h"
#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/gltf/scale_glb.h"
#include "stages/image/png_writer.h"
#include "stages/image/resize.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/scales/vertex_split.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMaxPreviewPixels = 1u << 24;

/// Per source image that has planes: the colour plane's preview, or a PNG with alpha where an alpha plane
/// stands beside it.
GlbImages preview_images(const Fragments& fragments, const Previews& previews) {
  GlbImages out;
  for (std::size_t i = 0; i < fragments.planes.size(); ++i) {
    const TexturePlane& plane = fragments.planes[i];
    if (plane.role == TextureRole::kAlpha || plane.mip > 0) continue;
    GlbImage image{plane.image, static_cast<std::uint32_t>(i), "image/jpeg", previews.planes.at(i).file, {}};
    for (std::size_t j = 0; j < fragments.planes.size(); ++j) {
      if (fragments.planes[j].image != plane.image || fragments.planes[j].role != TextureRole::kAlpha ||
          fragments.planes[j].mip > 0)
        continue;
      image.mime_type = "image/png";
      // The two previews may have different sizes: each is as fine as its bytes allow.
      image.bytes = write_png(joined_alpha(decode_jpeg(previews.planes.at(i).file, kMaxPreviewPixels),
                                           decode_jpeg(previews.planes.at(j).file, kMaxPreviewPixels)));
    }
    out.push_back(std::move(image));
  }
  return out;
}

/// Previews by their place in the package's tree; what is no entry of the package stays within the file.
GlbImages named_previews(GlbImages images) {
  for (GlbImage& i : images)
    if (i.mime_type == std::string_view("image/jpeg")) i.uri = "../" + preview_path(i.plane);
  return images;
}

/// What the stream rounds to: as Draco, whatever the files are; at most 24 bits.
VertexSplitCoding stream_coding(const ScaleCoding& coding, const std::vector<Material>& materials,
                                const std::vector<Image>& images) {
  constexpr int kMostBits = 24;
  VertexSplitCoding out;
  ScalesOptions most = coding.options;
  out.position = coding.position;
  if (out.position.bits == 0) out.position = position_grid(coding.mesh, most, kMostBits);
  for (int set = 0; set < 2; ++set)
    if (coding.write_uv[set])
      out.uv[set] =
          uv_grid(coding.uv_values(set), largest_texture_px(materials, images, set), most, kMostBits);
  most.position_bits = most.uv_bits = kMostBits;
  if (out.position.bits == 0) out.position = position_grid(coding.mesh, most, kMostBits);
  for (int set = 0; set < 2; ++set)
    if (coding.write_uv[set] && out.uv[set].bits == 0)
      out.uv[set] = uv_grid(coding.uv_values(set), 1, most, kMostBits);
  out.normal_bits = coding.options.normal_bits;
  out.colour_bits = coding.mesh.colours.empty() ? 0 : coding.fine_colours ? 16 : 8;
  out.merge_parts = coding.mesh.part_names.size() > kMostNodes;
  return out;
}

/// What the stream says of a scale that has no file.
ScaleFile count_streamed(const SplitStreamHead& head, int scale) {
  const auto found = std::ranges::find(head.scales, scale, &SplitScale::scale);
  return {scale, {}, found->triangles, found->wedges};
}

/// Whether the stream's scales show the triangles that files would. Files keep positions as they are where no
/// grid is fine enough (slivers of 1e-12 of the size); the stream has none but its grid.
bool shows_the_same(const std::vector<std::uint8_t>& stream, const NestedScales& scales,
                    const std::vector<std::size_t>& kept, const QuantisationGrid& grid) {
  const SplitStreamHead head = read_split_head(stream);
  std::vector<Vec3f> place;  // per position
  place.reserve(scales.mesh.positions.size());
  for (const Vec3f p : scales.mesh.positions) place.push_back(grid.bits > 0 ? grid.place(p) : p);
  const auto at = [&](std::uint32_t wedge) { return place[scales.mesh.wedge_position[wedge]]; };
  return std::ranges::all_of(kept, [&](std::size_t k) {
    const auto triangles = std::ranges::count_if(scales.scales[k].triangles, [&](const Triangle& t) {
      return grid.bits == 0 || !is_flat(at(t[0]), at(t[1]), at(t[2]));
    });
    return count_streamed(head, scales.scales[k].scale).triangles == static_cast<std::size_t>(triangles);
  });
}

void write_stream(const ScaleCoding& coding, const NestedScales& scales, const std::vector<std::size_t>& kept,
                  const std::vector<Material>& materials, const std::vector<Image>& images,
                  const RunContext& context, ScaleFiles& result) {
  if (!coding.options.stream || kept.size() < 2) return;
  try {
    result.stream = write_split_stream(
        make_vertex_splits(scales, kept, stream_coding(coding, materials, images), context));
    if (shows_the_same(result.stream, scales, kept, coding.position)) return;
    result.stream.clear();
    add_info(result.notes, "no-stream", "",
             "the scales have no vertex-split stream: triangles are too small for any grid");
  } catch (const FormatError& e) {
    add_info(result.notes, "no-stream", "",
             std::string("the scales have no vertex-split stream: ") + e.what());
  }
}

void note_parts(const Mesh& mesh, Notes& notes) {
  if (!parts_merged(mesh)) return;
  add_info(notes, "parts-merged", "",
           std::to_string(mesh.part_names.size()) + " parts became one node, because more than " +
               std::to_string(kMostNodes) +
               " would cost more bytes than the mesh; feature ids of the vertices count their names, which "
               "its mesh lists in extras.partNames");
}

void note_grid(const ScaleCoding& coding, std::size_t triangles, std::size_t written, Notes& notes) {
  const int bits = coding.position.bits, asked = coding.options.position_bits;
  if (bits > 0 && bits < asked)
    add_info(notes, "fewer-bits", "",
             "position_bits is " + std::to_string(asked) + ", of which mesh_codec " +
                 std::string(enum_name(coding.options.mesh_codec)) + " holds " + std::to_string(bits));
  if (written >= triangles) return;
  constexpr std::size_t kManyPart = 100;  // more than a hundredth of all: that may show
  const Severity severity =
      (triangles - written) * kManyPart > triangles ? Severity::kWarning : Severity::kInfo;
  notes.push_back({severity, "flattened-triangles", "scale 0",
                   std::to_string(triangles - written) + " of " + std::to_string(triangles) +
                       " triangles have two corners in one place of the grid of " + std::to_string(bits) +
                       " bits per coordinate, show nothing and were left out"});
}

/// As the manifest's will be.
std::vector<ManifestStep> steps_of(const MeasuredQuality& quality) {
  std::vector<ManifestScale> scales(quality.table.scales.size());
  for (std::size_t k = 0; k < scales.size(); ++k) {
    scales[k].scale = quality.table.scales[k];
    scales[k].display_px_flip = static_cast<double>(quality.display_px_flip.at(k));
  }
  return step_function(scales, StepRule::kFlip);
}

/// A scale of the stream that has a GLB beside it.
struct GlbBeside {
  const NestedScale* scale = nullptr;
  double up_to_px = 0;  // 0: it has no step
  GlbImages images;
  std::vector<WholeTexture> pictures;  // those of the images that are no previews
  std::uint32_t texture_px = 0;        // longest side of what it shows
  Bytes file;
};

std::vector<GlbBeside> scales_beside(const NestedScales& scales, const ScaleFiles& files,
                                     const std::vector<ManifestStep>& steps, ScaleGlbs which) {
  if (which == ScaleGlbs::kEnds || files.stream.empty()) return {};
  std::vector<GlbBeside> wanted;
  for (const ScaleFile& file : files.files) {
    const auto step = std::ranges::find(steps, file.scale, &ManifestStep::scale);
    if (!file.glb.empty() || (which == ScaleGlbs::kSteps && step == steps.end())) continue;
    GlbBeside& glb = wanted.emplace_back();
    glb.scale = &*std::ranges::find(scales.scales, file.scale, &NestedScale::scale);
    if (step != steps.end()) glb.up_to_px = step->up_to_px;
  }
  return wanted;
}

void choose_textures(const TexturedObject& object, const Fragments& fragments, GlbBeside& glb) {
  for (const WholeTexture& t : least_textures(object, glb.scale->scale, glb.up_to_px, kGltfFlip)) {
    if (t.rung == WholeTexture::kPreview) continue;
    const std::string path = gltf_image_path(t.plane, t.rung);
    std::ranges::find(glb.images, t.base, &GlbImage::plane)->uri = path.substr(path.rfind('/') + 1);
    glb.pictures.push_back(t);
    const TexturePlane& plane = fragments.planes[t.plane];
    glb.texture_px = std::max({glb.texture_px, plane.width_px, plane.height_px});
  }
}

/// Octahedral. As many steps as pixels are enough; beside other losses more than 9 bits are not seen.
int normal_bits_at(double displayed_px) {
  return std::clamp(static_cast<int>(std::ceil(std::log2(displayed_px))), 7, 9);
}

/// With a step: on grids of half a pixel at its switch size and of half a texel.
Bytes code_beside(const ScaleCoding& coding, const GlbBeside& glb, const std::vector<Material>& materials,
                  ScaleFrames frames) {
  ScaleCoding own = coding;
  own.frames = std::move(frames);
  if (glb.up_to_px > 0) {
    own.options.normal_bits = std::min(own.options.normal_bits, normal_bits_at(glb.up_to_px));
    coarsen_positions(own.position, 2 * glb.up_to_px, own.mesh, glb.scale->triangles);
    if (own.options.mesh_codec == MeshCodec::kDraco)
      for (QuantisationGrid& uv : own.uv) coarsen(uv, 2.0 * glb.texture_px * static_cast<double>(uv.range));
  }
  return write_scale(own, *glb.scale, materials, glb.images).glb;
}

/// The finest go until all GLBs together take no more than kMostOverFinest of S_0's and kAnywayBytes.
void leave_out_finest(const ScaleFiles& files, std::vector<GlbBeside>& made, Notes& notes) {
  double room = (kMostOverFinest - 1) * static_cast<double>(files.files.front().glb.size()) + kAnywayBytes -
                static_cast<double>(files.files.back().glb.size());
  for (const GlbBeside& glb : made) room -= static_cast<double>(glb.file.size());
  for (; room < 0 && !made.empty(); made.erase(made.begin())) {
    room += static_cast<double>(made.front().file.size());
    add_info(notes, "no-glb", "scale " + std::to_string(made.front().scale->scale),
             "has no GLB: all would take over 2.2 times S_0's bytes and 32 kB (scales.glb all writes it)");
  }
}

/// What rules of format/rules read of the planes.
std::vector<TextureInfo> describe_planes(const Fragments& fragments) {
  std::vector<TextureInfo> out;
  for (const TexturePlane& plane : fragments.planes) {
    TextureInfo& t = out.emplace_back();
    t.image = plane.image, t.mip = plane.mip, t.base = plane.base, t.role = enum_name(plane.role);
  }
  return out;
}

/// `pixels` may be larger than the plane: whole fragments.
Bytes whole_plane(const TexturePlane& plane, const Pixels& pixels, int quality) {
  JpegKind kind;
  kind.channels = pixels.channels;
  kind.rgb = !is_colour(plane.role) && pixels.channels == 3;
  kind.file = FileSteps{static_cast<double>(quality), false, false};
  return JpegCoder(kind).complete(
      {pixels.data.data(), std::size_t{pixels.width_px} * pixels.channels, plane.width_px, plane.height_px});
}

}  // namespace

ScaleFiles write_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                        const std::vector<Material>& materials, const std::vector<Image>& images,
                        const Fragments& fragments, const Previews& previews, const ScalesOptions& options,
                        const RunContext& context) {
  const ScaleCoding coding = make_coding(scales.mesh, materials, images, options);
  const GlbImages embedded = preview_images(fragments, previews), named = named_previews(embedded);
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < scales.scales.size(); ++k)
    if (k == 0 || (k < perceptual.kept.size() && perceptual.kept[k])) kept.push_back(k);
  ScaleFiles result;
  note_parts(scales.mesh, result.notes);
  result.position_bits = coding.position.bits;
  result.uv_bits = coding.write_uv[0] ? coding.uv[0].bits : 0;
  result.position_error = largest_rounding(scales.mesh, coding.position);
  result.files.resize(kept.size());
  const auto write_file = [&](std::size_t i) {
    ScaleCoding lit = coding;
    lit.frames = scale_frames(scales, kept[i], context);
    result.files[i] =
        write_scale(lit, scales.scales[kept[i]], materials, i + 1 == kept.size() ? embedded : named);
  };
  const std::size_t tasks = 1 + (options.stream ? std::min<std::size_t>(kept.size(), 2) : kept.size());
  std::atomic<std::size_t> made = 0;
  const auto made_one = [&] { context.report(static_cast<double>(++made) / static_cast<double>(tasks + 1)); };
  // The stream and S_0's file take about as long. These two scales have files beside any stream.
  const std::size_t always = std::min<std::size_t>(kept.size(), 2);
  parallel_each(context, 1 + always, 1, [&](std::size_t task) {
    if (task == 0)
      write_stream(coding, scales, kept, materials, images, context, result);
    else
      write_file(task == 1 ? 0 : kept.size() - 1);
    made_one();
  });
  const std::size_t between = kept.size() - always;
  if (!result.stream.empty()) {
    const SplitStreamHead head = read_split_head(result.stream);
    for (std::size_t i = 1; i <= between; ++i)
      result.files[i] = count_streamed(head, scales.scales[kept[i]].scale);
  } else {
    parallel_for(context, between, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin + 1; i <= end; ++i) {
        write_file(i);
        if (made < tasks) made_one();  // a stream that was given up leaves more files than were counted
      }
    });
  }
  note_grid(coding, scales.scales[0].triangles.size(), result.files[0].triangles, result.notes);
  return result;
}

GltfScales write_gltf_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                             const std::vector<Material>& materials, const std::vector<Image>& images,
                             const Fragments& fragments, const std::vector<Pixels>& filled,
                             const Previews& previews, const PackageTables& tables, const ScaleFiles& files,
                             const MeasuredQuality& quality, const ScalesOptions& options,
                             const RunContext& context) {
  std::vector<GlbBeside> wanted = scales_beside(scales, files, steps_of(quality), options.glb);
  if (wanted.empty()) return {};
  const ScaleCoding coding = make_coding(scales.mesh, materials, images, options);
  const std::vector<TextureInfo> textures = describe_planes(fragments);
  const TexturedObject object{quality.table, textures, tables.planes,
                              surface_area(scales.mesh, scales.scales.front().triangles),
                              static_cast<double>(perceptual.object_height)};
  const GlbImages shown = named_previews(preview_images(fragments, previews));
  for (GlbBeside& glb : wanted) {
    glb.images = shown;
    for (const PlanePreview& p : previews.planes)
      glb.texture_px = std::max({glb.texture_px, p.width_px, p.height_px});
    if (glb.up_to_px > 0 && !textures.empty()) choose_textures(object, fragments, glb);
  }
  parallel_each(context, wanted.size(), 1, [&](std::size_t k) {
    const auto row = static_cast<std::size_t>(wanted[k].scale - scales.scales.data());
    wanted[k].file = code_beside(coding, wanted[k], materials, scale_frames(scales, row, context));
  });
  GltfScales out;
  if (options.glb == ScaleGlbs::kSteps) leave_out_finest(files, wanted, out.notes);
  std::map<std::string, WholeTexture> pictures;
  for (const GlbBeside& glb : wanted)
    for (const WholeTexture& t : glb.pictures) pictures[gltf_image_path(t.plane, t.rung)] = t;
  for (const auto& [path, unused] : pictures) out.files.push_back({path, {}});
  parallel_each(context, out.files.size(), 1, [&](std::size_t k) {
    const WholeTexture& t = pictures.at(out.files[k].path);
    out.files[k].bytes = whole_plane(fragments.planes[t.plane], filled.at(t.plane),
                                     tables.planes[t.plane].rung_quality[t.rung]);
  });
  for (GlbBeside& glb : wanted) out.files.push_back({gltf_scale_path(glb.scale->scale), std::move(glb.file)});
  return out;
}

std::vector<std::uint8_t> write_streamed_scale(const Mesh& mesh, const SplitStreamHead& head,
                                               const ScalesOptions& options, bool hasty) {
  const auto grid = [](const SplitGrid& g) {
    return QuantisationGrid{g.bits, {g.origin[0], g.origin[1], g.origin[2]}, g.range};
  };
  std::uint16_t materials = 0;
  for (const std::uint16_t m : mesh.triangle_material) materials = std::max(materials, m);
  ScaleCoding coding{mesh,
                     options,
                     {},
                     {},
                     {!mesh.uv0.empty(), !mesh.uv1.empty()},
                     needs_fine_colours(mesh.colours),
                     std::vector<bool>(materials + std::size_t{1}, true),
                     {mesh.normals, mesh.tangents}};
  if (hasty) coding.draco_speed = kDracoFastest;
  constexpr int kShortBits = 16;
  const bool draco = options.mesh_codec == MeshCodec::kDraco;
  if (draco || (options.mesh_codec != MeshCodec::kNone && head.position.bits <= kShortBits))
    coding.position = grid(head.position);
  if (draco)
    for (const SplitAttribute& a : head.attributes)
      if (a.kind == SplitKind::kUv0 || a.kind == SplitKind::kUv1)
        coding.uv[a.kind == SplitKind::kUv1 ? 1 : 0] = grid(a.grid);
  NestedScale scale;
  scale.triangles = mesh.triangles;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) scale.triangle_source.push_back(t);
  return write_scale(coding, scale, std::vector<Material>(materials + std::size_t{1}), {}).glb;
}

}  // namespace texmesh
