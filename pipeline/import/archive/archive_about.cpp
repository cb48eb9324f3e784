#include "pipeline/import/archive/archive_about.h"

#include "pipeline/about/source_annotations.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMaxTextBytes = 65'536;

/// The file of at most so many bytes that is least deep of those whose last part, in small letters, is
/// `wanted`.
const ArchivedFile* least_deep(const ArchiveFiles& archive, std::uint64_t max_bytes, const auto& wanted) {
  const ArchivedFile* found = nullptr;
  for (const ArchivedFile& f : archive.files())
    if (wanted(lower(f.name.substr(f.name.rfind('/') + 1))) && f.bytes <= max_bytes &&
        (!found || std::ranges::count(f.name, '/') < std::ranges::count(found->name, '/')))
      found = &f;
  return found;
}

/// The text of the file with this last part, in any case, that is least deep; "" without one.
std::string text_named(ArchiveFiles& archive, std::string_view last) {
  const ArchivedFile* found =
      least_deep(archive, kMaxTextBytes, [&](const std::string& name) { return name == last; });
  if (!found) return "";
  const Bytes bytes = archive.unpacked(*found, kMaxTextBytes);
  return utf8_of(text_of(bytes));
}

/// "* title:  A bust" of Sketchfab's license.txt, and the line that others shall write.
void read_licence_text(const std::string& text, About& about, Notes& notes) {
  LineReader lines(text);
  for (std::string_view line; lines.next(line);) {
    line = trim(line);
    if (line.starts_with("This work is based on"))
      set_source_field(about, "attribution", std::string(line), "license.txt", notes);
    if (!line.starts_with('*')) continue;
    line = trim(line.substr(1));
    const std::size_t colon = line.find(':');
    if (colon == line.npos) continue;
    const std::string_view name = line.substr(0, colon);
    set_source_field(about, name == "license type" ? "license" : name,
                     std::string(trim(line.substr(colon + 1))), "license.txt", notes);
  }
}

/// "WGS84 UTM 32N".
void read_coordinates(const std::string& text, About& about, Notes& notes) {
  LineReader lines(text);
  std::string_view line;
  if (!lines.next(line)) return;
  line = trim(line);
  constexpr std::string_view kUtm = "WGS84 UTM ";
  if (!line.starts_with(kUtm) || line.size() < kUtm.size() + 2) return;
  set_source_field(about, "crs", std::string(line), "coords.txt", notes);
  std::int64_t zone = 0;
  const char half = line.back();
  if (!parse_integer(line.substr(kUtm.size(), line.size() - kUtm.size() - 1), zone) || zone < 1 ||
      zone > 60 || (half != 'N' && half != 'S'))
    return;
  constexpr std::int64_t kNorth = 32600, kSouth = 32700;
  set_source_field(about, "epsg", std::to_string((half == 'N' ? kNorth : kSouth) + zone), "coords.txt",
                   notes);
}

}  // namespace

About archive_about(ArchiveFiles& archive, const std::string& model, Notes& notes) {
  About about;
  read_licence_text(text_named(archive, "license.txt"), about, notes);
  if (lower(model).find("odm_textured_model") == std::string::npos) return about;
  set_source_field(about, "unit", "metre", model, notes);
  set_source_field(about, "up axis", "z", model, notes);
  for (const char* name : {"coords.txt", "proj.txt"})
    if (about.crs.empty()) read_coordinates(text_named(archive, name), about, notes);
  return about;
}

std::optional<std::pair<std::string, Bytes>> archived_annotations(ArchiveFiles& archive) {
  const auto named = [&](const auto& wanted) { return least_deep(archive, kMaxNotesFileBytes, wanted); };
  const ArchivedFile* found = named([](const std::string& name) { return name == "annotations.json"; });
  if (!found) found = named([](const std::string& name) { return name.ends_with("svx.json"); });
  if (!found) return {};
  return std::pair(readable_name(found->name), archive.unpacked(*found, kMaxNotesFileBytes));
}

}  // namespace texmesh
