#include <algorithm>
#include <cstring>
#include <string_view>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

bool starts_with(std::span<const std::uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && !std::memcmp(bytes.data(), magic.data(), magic.size());
}

// A binary STL has no magic, but its size follows from its count.
bool is_binary_stl(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 84) return false;
  std::uint32_t triangles;
  std::memcpy(&triangles, bytes.data() + 80, 4);
  return triangles > 0 && bytes.size() == 84 + std::uint64_t{50} * triangles;
}

enum class Kind { kGltf, kObj, kPly, kStl, kRange };

Kind kind_of(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  if (starts_with(bytes, "glTF")) return Kind::kGltf;
  if (starts_with(bytes, "ply\n") || starts_with(bytes, "ply\r")) return Kind::kPly;
  if (starts_with(bytes, "Cyberware")) return Kind::kRange;
  const std::string extension = lower_extension(file_name);
  if (extension == "gltf" || extension == "glb") return Kind::kGltf;
  if (extension == "obj") return Kind::kObj;
  if (extension == "ply") return Kind::kPly;
  if (extension == "stl") return Kind::kStl;
  if (extension == "json" || extension == "cyl") return Kind::kRange;
  if (is_binary_stl(bytes)) return Kind::kStl;
  throw InputError(file_name, "", "a glTF, GLB, OBJ, PLY or STL model or a range scan (.json, Cyberware)",
                   extension.empty() ? "a name without extension and content of another kind"
                                     : "content of another kind named ." + extension);
}

ImportedModel import_kind(Kind kind, const std::string& file_name, std::span<const std::uint8_t> bytes,
                          Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  switch (kind) {
    case Kind::kGltf:
      return import_gltf(file_name, bytes, resolver, options, context);
    case Kind::kObj:
      return import_obj(file_name, bytes, resolver, options, context);
    case Kind::kPly:
      return import_ply(file_name, bytes, resolver, options, context);
    case Kind::kStl:
      return import_stl(file_name, bytes, options, context);
    case Kind::kRange:
      break;
  }
  return import_range_scan(file_name, bytes, resolver, options, context);
}

}  // namespace

ImportedModel import_model(const std::string& file_name, std::span<const std::uint8_t> bytes,
                           Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  if (bytes.empty()) throw InputError(file_name, "", "a model", "an empty file");
  if (static_cast<double>(bytes.size()) > options.max_file_bytes)
    throw InputError(
        file_name, "",
        "at most " + std::to_string(static_cast<std::uint64_t>(options.max_file_bytes)) + " bytes",
        std::to_string(bytes.size()));
  ImportedModel imported =
      import_kind(kind_of(file_name, bytes), file_name, bytes, resolver, options, context);
  if (imported.about.source.empty()) imported.about.source = "{\"format\":\"" + imported.format + "\"}";
  // The user has said which axis is up, or the model has been turned.
  if (options.up != UpAxis::kKeep) imported.about.up_axis = "y";
  return imported;
}

}  // namespace texmesh
