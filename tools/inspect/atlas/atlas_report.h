#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/import/import.h"
#include "stages/measure/atlas/atlas_figures.h"
#include "tools/inspect/notes_count.h"

namespace texmesh {

inline constexpr Range kShareRange{0, 1}, kNotNegative{0, 1e300};

template <>
struct RecordFields<SurfacePercentiles> {
  static void fields(auto& s, auto&& v) {
    v("p5", s.p5, kNotNegative, "");
    v("p50", s.p50, kNotNegative, "");
    v("p95", s.p95, kNotNegative, "");
    v("p99", s.p99, kNotNegative, "");
  }
};

template <>
struct RecordFields<SeamColours> {
  static void fields(auto& s, auto&& v) {
    v("mean", s.mean, kNotNegative, "");
    v("p95", s.p95, kNotNegative, "");
    v("inside", s.inside, kNotNegative, "from the seam to one texel further in, in the mean");
  }
};

/// A model, or S_0 of a package, as measure_atlases() takes it. `images` points into `colours`, so a subject
/// is moved, never copied.
struct AtlasSubject {
  Mesh mesh;
  std::vector<Material> materials;
  std::vector<std::string> image_names;  // as the file names them; "" = not at all
  std::vector<AtlasImage> images;
  std::vector<Pixels> colours;  // by image; those of base colours alone are decoded
  Notes notes;                  // of the import

  AtlasSubject() = default;
  AtlasSubject(AtlasSubject&&) = default;
  AtlasSubject& operator=(AtlasSubject&&) = default;
};

/// A file that compile would take. Decodes its base-colour textures. Errors as import_file(), and InputError
/// for an image that does not decode. Same result for any thread count.
AtlasSubject atlas_subject(const std::string& path, const RunContext& context);
/// The same of a model in memory.
AtlasSubject atlas_subject(Model model, const RunContext& context);
/// S_0 as the package has it, so coordinates are rounded as its codec rounds them; colours of the best rungs.
/// FormatError when the package is damaged.
AtlasSubject atlas_subject(PackageReader& package, const RunContext& context);

/// Bytes of a triangle in a coarse mesh with many seams: files of the coarse scales of photogrammetry scans
/// have 7 to 8 (Draco or meshopt, with normals and texture coordinates).
inline constexpr double kBytesPerFloorTriangle = 8;

/// Something about an atlas that costs, and what to do against it.
struct AtlasAdvice {
  std::string code, atlas;
  std::string found;   // what is so, and why that costs; sentences
  std::string remedy;  // what to do; sentences
  static void fields(auto& s, auto&& v) {
    v("code", s.code, FieldRule{.words = "charts|thin|cover|overlap|seams|density|stretch|flat|folded|far"},
      "");
    v("atlas", s.atlas, "the texture's name; empty = the model as a whole");
    v("found", s.found, "");
    v("remedy", s.remedy, "");
  }
};

/// Figures of an atlas, as messages call it: "texture 0 (colour.jpg)".
struct NamedAtlas : AtlasFigures {
  std::string name;
  static void fields(auto& s, auto&& v) {
    v("image", s.image,
      "index into the model's images, unused ones left out; of a package's S_0, into that file's");
    v("name", s.name, "as messages call the texture");
    v("width_px", s.width_px, Range{1, 4294967295.0}, "");
    v("height_px", s.height_px, Range{1, 4294967295.0}, "");
    v("materials", s.materials, "whose base-colour texture (without one, first texture) it is");
    v("triangles", s.triangles, "");
    v("charts", s.charts, "");
    v("small_charts", s.small_charts, "of at most 8 triangles");
    v("thin_charts", s.thin_charts, "thinner than 8 texels");
    v("mirrored_charts", s.mirrored_charts, "");
    v("largest_chart", s.largest_chart, kShareRange, "share of the charts' texels");
    v("cover", s.cover, kShareRange, "texels that the surface shows, of all");
    v("thin", s.thin_share, kShareRange, "of the charts' texels, those of thin charts");
    v("overlap", s.overlap, kShareRange, "of the shown texels, those that two places show");
    v("density", s.density, "texels per object unit, over the surface");
    v("density_spread", s.density_spread(), kNotNegative, "p95 over p5 of density");
    v("stretch", s.stretch, "longer over shorter axis of a circle of the surface on the texture");
    v("flat_triangles", s.flat_triangles, "without area on the texture");
    v("flat_surface", s.flat_surface, kShareRange, "their share of the surface");
    v("folded_triangles", s.folded_triangles, "");
    v("far_triangles", s.far_triangles, "");
    v("edges", s.edges, "");
    v("seam_edges", s.seam_edges, "");
    v("positions", s.positions, "");
    v("vertices", s.vertices, "positions with different texture coordinates apart");
    v("triangle_floor", s.triangle_floor,
      "fewest triangles of a mesh that keeps every chart beside its neighbours");
    v("seam_colours", OrNull<SeamColours>{s.seam_colours},
      "CIE 1976 differences across seams; null = not compared");
  }
};

/// What doctor and dump say of the atlases of a model: figures with names, advice.
struct AtlasDiagnosis {
  std::vector<NamedAtlas> atlases;
  std::vector<std::string> materials;  // by material; "" = without a name
  std::uint64_t triangles = 0, untextured_triangles = 0;
  std::string nothing;              // why there is no atlas; "" = there is one
  std::vector<AtlasAdvice> advice;  // the costliest first

  std::uint64_t sum(std::uint64_t AtlasFigures::*figure) const;
  std::uint64_t charts() const { return sum(&AtlasFigures::charts); }
  std::uint64_t triangle_floor() const { return sum(&AtlasFigures::triangle_floor); }
  std::uint64_t floor_bytes() const;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("triangles", s.triangles, "");
    v("untextured_triangles", s.untextured_triangles, "");
    v("charts", s.charts(), "");
    v("triangle_floor", s.triangle_floor(), "");
    v("floor_bytes", s.floor_bytes(), "about what a mesh of so many triangles takes");
    v("nothing", s.nothing, "why there is no atlas; empty = there is one");
    v("atlases", s.atlases, "");
    v("advice", s.advice, "");
  }
};
AtlasDiagnosis diagnose_atlases(const AtlasSubject& subject, const RunContext& context);

/// For people: a block of lines for each texture, then what to do.
std::string atlas_text(const AtlasDiagnosis& diagnosis);

/// What compile --atlas auto does with such a model, and why; a sentence.
std::string auto_atlas_text(const AtlasDiagnosis& diagnosis);

/// What `doctor --json` prints.
struct DoctorReport {
  std::string input;  // file name, no folder
  AtlasDiagnosis diagnosis;
  std::vector<std::string> reasons;  // the limits that are not kept
  std::optional<NotesCount> notes;
  std::optional<std::string> auto_atlas;  // of a model
  static void fields(auto& s, auto&& v) {
    v("input", s.input, "file name, no folder");
    AtlasDiagnosis::fields(s.diagnosis, v);
    v("good", s.reasons.empty(), "every limit is kept");
    v("reasons", s.reasons, "the limits that are not");
    v("notes", s.notes, "where a package has notes at points");
    v("auto_atlas", s.auto_atlas, "what compile --atlas auto does with a model, and why");
  }
};

}  // namespace texmesh
