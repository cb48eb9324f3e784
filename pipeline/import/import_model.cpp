#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "pipeline/import/archive/archive_files.h"
#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"
#include "pipeline/import/up_axis.h"

namespace texmesh {
namespace {

bool starts_with(std::span<const std::uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && !std::memcmp(bytes.data(), magic.data(), magic.size());
}

// A binary STL has no magic, but its size follows from its count.
bool is_binary_stl(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 84) return false;
  const auto triangles = value_at<std::uint32_t>(bytes.data() + 80);
  return triangles > 0 && bytes.size() == 84 + std::uint64_t{50} * triangles;
}

enum class Kind { kGltf, kObj, kPly, kStl, kRange };

constexpr const char* kExpected =
    "a glTF, GLB, OBJ, PLY or STL model, a ZIP archive of one, or a range scan (.json, Cyberware)";

Kind kind_of(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  if (starts_with(bytes, "glTF")) return Kind::kGltf;
  if (starts_with(bytes, "ply\n") || starts_with(bytes, "ply\r")) return Kind::kPly;
  if (starts_with(bytes, "Cyberware")) return Kind::kRange;
  if (const std::string foreign = foreign_file(bytes); !foreign.empty() && !is_binary_stl(bytes))
    throw InputError(file_name, "first bytes", kExpected, foreign);
  const std::string extension = lower_extension(file_name);
  if (extension == "gltf" || extension == "glb") return Kind::kGltf;
  if (extension == "obj") return Kind::kObj;
  if (extension == "ply") return Kind::kPly;
  if (extension == "stl") return Kind::kStl;
  if (extension == "json" || extension == "cyl") return Kind::kRange;
  if (is_binary_stl(bytes)) return Kind::kStl;
  constexpr std::string_view kPointClouds = " xyz pts ptx las laz e57 pcd ",
                             kSplats = " splat ksplat spz sog ";
  const std::string named = " " + extension + " ";
  if (kPointClouds.find(named) != kPointClouds.npos || kSplats.find(named) != kSplats.npos)
    throw InputError(file_name, "", kExpected,
                     kSplats.find(named) != kSplats.npos
                         ? "Gaussian splats: texmesh reads surfaces"
                         : "a point cloud: texmesh reads surfaces; mesh it first");
  throw InputError(file_name, "", kExpected,
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

/// Adds to what the package says of its source, where there is room.
void add_to_source(About& about, const char* key, nlohmann::ordered_json value) {
  auto source = nlohmann::ordered_json::parse(about.source, nullptr, false);
  if (!source.is_object()) return;
  source[key] = std::move(value);
  std::string with_value = source.dump();
  if (with_value.size() <= kMaxAboutSourceBytes) about.source = std::move(with_value);
}

/// Where the user has not said which axis is up: the source's word, else a guess. glTF says that y is, and
/// eastings and northings leave z for heights.
void turn_by_source(ImportedModel& m) {
  const bool said = !m.about.up_axis.empty();
  const bool may_guess = m.format == "obj" || m.format == "ply" || m.format == "stl";
  char up = said ? m.about.up_axis[0] : may_guess ? guessed_up(m.model.mesh) : '\0';
  const bool by_crs = up == '\0' && may_guess && (!m.about.crs.empty() || m.about.epsg != 0);
  if (by_crs) up = 'z';
  if (up != 'x' && up != 'z') return;
  turn_up(m.model.mesh, up);
  m.about.up_axis = "y";
  add_info(m.model.notes, kTurnedNote, "",
           std::string(said     ? "the source says that "
                       : by_crs ? "as in its coordinate reference "
                                : "by its flat bottom ") +
               up + " is up; turned so that y is (--up keep leaves it as it is)");
  add_to_source(m.about, kTurnedMember,
                {{"up", std::string(1, up)}, {"by", said ? "the source's word" : "a guess"}});
}

/// One line, and the same for those who get the package.
void tell_what_is_lost(ImportedModel& imported) {
  if (imported.lost.empty()) return;
  constexpr std::size_t kMostTold = 6;
  std::string text;
  std::size_t told = 0;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& [what, count] : imported.lost) {
    list.push_back({{"what", clean_text(what, kMaxAboutNameBytes)}, {"count", count}});
    if (told++ < kMostTold) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + what;
  }
  if (told > kMostTold) text += " and " + std::to_string(told - kMostTold) + " more kinds";
  add_info(imported.model.notes, kLostNote, "", text + " of the source are not in the package");
  add_to_source(imported.about, "lost", std::move(list));
}

/// "fox.fbx, fox.png and 3 more files"; an archive in an archive is told, and what to do.
std::string other_files(const std::vector<ArchivedFile>& files) {
  constexpr std::size_t kMostTold = 3;
  std::string text;
  for (const ArchivedFile& f : files)
    if (lower_extension(f.name) == "zip")
      return readable_name(f.name) + ", an archive in the archive: unpack the outer one and compile that";
  for (std::size_t k = 0; k < std::min(files.size(), kMostTold); ++k)
    text += (k ? ", " : "") + readable_name(files[k].name) + (files[k].is_link ? " (a symbolic link)" : "");
  if (files.size() > kMostTold) text += " and " + std::to_string(files.size() - kMostTold) + " more";
  return text.empty() ? "no file" : text + " alone";
}

/// The model of a ZIP archive, with what the archive says of it.
ImportedModel import_archive(const std::string& file_name, ByteSpan bytes, const ImportOptions& options,
                             const RunContext& context) {
  const auto most = static_cast<std::uint64_t>(options.max_file_bytes);
  ArchiveFiles archive(file_name, bytes, most);
  if (archive.model().empty())
    throw InputError(file_name, "", "an archive with a .gltf, .glb, .obj, .ply or .stl file",
                     other_files(archive.files()));
  const auto entry = std::ranges::find(archive.files(), archive.model(), &ArchivedFile::name);
  const std::string name = file_name + "/" + readable_name(archive.model());
  const Bytes model = archive.unpacked(*entry, most);
  if (starts_with(model, "PK")) throw InputError(name, "first bytes", kExpected, "another archive");
  ImportOptions of_model = options;
  if (options.up == UpAxis::kAuto) of_model.up = UpAxis::kKeep;  // turned when the archive has had its word
  ImportedModel imported = import_model(name, model, archive, of_model, context);
  imported.about = merge_about(archive_about(archive, archive.model(), imported.model.notes), imported.about);
  if (options.up == UpAxis::kAuto) turn_by_source(imported);
  if (options.up > UpAxis::kKeep) imported.about.up_axis = "y";
  return imported;
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
  if (starts_with(bytes, "PK\3\4") || starts_with(bytes, "PK\5\6"))
    return import_archive(file_name, bytes, options, context);
  if (starts_with(bytes, "\xef\xbb\xbf")) bytes = bytes.subspan(3);  // of a text: no part of it
  ImportedModel imported =
      import_kind(kind_of(file_name, bytes), file_name, bytes, resolver, options, context);
  drop_hidden_twins(imported.model, file_name, imported.lost);
  if (imported.about.source.empty()) imported.about.source = "{\"format\":\"" + imported.format + "\"}";
  tell_what_is_lost(imported);
  if (options.up == UpAxis::kAuto) turn_by_source(imported);
  // The user has said which axis is up, or the model has been turned.
  if (options.up > UpAxis::kKeep) imported.about.up_axis = "y";
  return imported;
}

namespace {

/// Draco gets below a byte a triangle.
constexpr std::uint64_t kMostPerByte = 8;

std::uint64_t number(const nlohmann::json& object, const char* key, std::uint64_t otherwise) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : otherwise;
}

std::uint64_t triangles_of_primitive(const nlohmann::json& primitive, const nlohmann::json& accessors) {
  constexpr std::uint64_t kTriangles = 4, kNone = ~std::uint64_t{0};
  if (!primitive.is_object() || number(primitive, "mode", kTriangles) != kTriangles) return 0;
  std::uint64_t accessor = number(primitive, "indices", kNone);
  if (const auto attributes = primitive.find("attributes");
      accessor == kNone && attributes != primitive.end() && attributes->is_object())
    accessor = number(*attributes, "POSITION", kNone);
  if (accessor >= accessors.size() || !accessors[accessor].is_object()) return 0;
  return std::min<std::uint64_t>(number(accessors[accessor], "count", 0), 1ull << 40) / 3;
}

/// The import parses the JSON again: this is asked before any stage runs, and a stage is given bytes.
std::uint64_t triangles_of_glb(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 20) return 0;
  const auto json_bytes = value_at<std::uint32_t>(bytes.data() + 12);
  if (json_bytes > bytes.size() - 20) return 0;
  const ByteSpan json = bytes.subspan(20, json_bytes);
  const JsonShape shape = scan_json_shape(json, kMaxGltfJsonDepth);
  if (shape.too_deep || shape.values > kMaxGltfJsonValues) return 0;
  const nlohmann::json root = nlohmann::json::parse(json.begin(), json.end(), nullptr, false);
  if (!root.is_object() || !root.contains("meshes") || !root.contains("accessors") ||
      !root["meshes"].is_array() || !root["accessors"].is_array())
    return 0;
  std::uint64_t sum = 0;
  for (const nlohmann::json& mesh : root["meshes"])
    if (mesh.is_object() && mesh.contains("primitives") && mesh["primitives"].is_array())
      for (const nlohmann::json& primitive : mesh["primitives"])
        sum += triangles_of_primitive(primitive, root["accessors"]);
  return sum;
}

std::uint64_t faces_of_ply(std::string_view text) {
  constexpr std::string_view kFaces = "\nelement face ";
  const std::string_view head = text.substr(0, std::min(text.find("end_header"), text.size()));
  const std::size_t at = head.find(kFaces);
  std::uint64_t count = 0;
  for (std::size_t i = at + kFaces.size(); at != head.npos && i < head.size() && count < (1ull << 40); ++i) {
    if (head[i] < '0' || head[i] > '9') break;
    count = 10 * count + static_cast<std::uint64_t>(head[i] - '0');
  }
  return count;
}

std::uint64_t faces_of_obj(std::string_view text) {
  std::uint64_t count = 0;
  for (std::size_t at = 0; at < text.size();) {
    count += text[at] == 'f' && at + 1 < text.size() && text[at + 1] == ' ';
    const void* end = std::memchr(text.data() + at, '\n', text.size() - at);
    if (!end) break;
    at = static_cast<std::size_t>(static_cast<const char*>(end) - text.data()) + 1;
  }
  return count;
}

std::uint64_t said(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string extension = lower_extension(file_name);
  if (text.starts_with("glTF")) return triangles_of_glb(bytes);
  if (text.starts_with("ply")) return faces_of_ply(text);
  if (extension == "obj") return faces_of_obj(text);
  return is_binary_stl(bytes) ? value_at<std::uint32_t>(bytes.data() + 80) : 0;
}

}  // namespace

std::uint64_t count_triangles(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  const std::uint64_t count = said(file_name, bytes);
  return count <= kMostPerByte * bytes.size() ? count : 0;
}

}  // namespace texmesh
