#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tools/inspect/atlas/atlas_subject.h"

namespace texmesh {

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

/// What doctor and dump say of the atlases of a model: figures with names, advice.
struct AtlasDiagnosis {
  AtlasReport report;
  std::vector<std::string> names;      // by atlas, as messages call it: "texture 0 (colour.jpg)"
  std::vector<std::string> materials;  // by material; "" = without a name
  std::uint64_t triangles = 0;
  std::string nothing;              // why there is no atlas; "" = there is one
  std::vector<AtlasAdvice> advice;  // the costliest first

  std::uint64_t charts() const;
  std::uint64_t triangle_floor() const;
  std::uint64_t floor_bytes() const;
};
AtlasDiagnosis diagnose_atlases(const AtlasSubject& subject, const RunContext& context);

/// For people: a block of lines for each texture, then what to do.
std::string atlas_text(const AtlasDiagnosis& diagnosis);
/// The members of schemas/doctor.v1.schema.json but for input and limits.
nlohmann::ordered_json atlas_json(const AtlasDiagnosis& diagnosis);

}  // namespace texmesh
