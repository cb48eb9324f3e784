#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/import/import.h"
#include "pipeline/io/record.h"
#include "stages/measure/atlas/atlas_figures.h"

namespace texmesh {

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
  std::string
      code;  // "charts", "thin", "cover", "overlap", "density", "stretch", "seams", "flat", "folded", "far"
  std::string atlas;   // the texture's name in messages; "" = the model as a whole
  std::string found;   // what is so, and why that costs; sentences
  std::string remedy;  // what to do; sentences
};

/// Figures of an atlas, as messages call it: "texture 0 (colour.jpg)".
struct NamedAtlas : AtlasFigures {
  std::string name;
};

/// What doctor and dump say of the atlases of a model: figures with names, advice.
struct AtlasDiagnosis {
  std::vector<NamedAtlas> atlases;
  std::vector<std::string> materials;  // by material; "" = without a name
  std::uint64_t triangles = 0, untextured_triangles = 0;
  std::string nothing;              // why there is no atlas; "" = there is one
  std::vector<AtlasAdvice> advice;  // the costliest first

  std::uint64_t charts() const;
  std::uint64_t triangle_floor() const;
  std::uint64_t floor_bytes() const;
};
AtlasDiagnosis diagnose_atlases(const AtlasSubject& subject, const RunContext& context);

/// For people: a block of lines for each texture, then what to do.
std::string atlas_text(const AtlasDiagnosis& diagnosis);

/// What `doctor --json` prints.
struct DoctorReport {
  std::string input;  // file name, no folder
  AtlasDiagnosis diagnosis;
  std::vector<std::string> reasons;  // the limits that are not kept
};
nlohmann::ordered_json doctor_json(const DoctorReport& report);
/// The same without input, good and reasons.
nlohmann::ordered_json atlas_json(const AtlasDiagnosis& diagnosis);
DocumentSchema doctor_schema();

}  // namespace texmesh
