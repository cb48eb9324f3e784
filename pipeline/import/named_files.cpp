#include "pipeline/import/named_files.h"

#include <algorithm>
#include <set>

#include "format/container/layout.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {

namespace {

constexpr std::size_t kMostParts = 256;

std::string_view without_quotes(std::string_view s) {
  s = trim(s);
  if (s.size() >= 2 && (s.front() == '"' || s.front() == '\'') && s.back() == s.front())
    s = trim(s.substr(1, s.size() - 2));
  return s;
}

/// What may be meant by the text, in order.
std::vector<std::string> readings_of(const NameInModel& name) {
  std::vector<std::string> readings;
  const auto add = [&](std::string text) {
    std::replace(text.begin(), text.end(), '\\', '/');
    if (!text.empty() && std::find(readings.begin(), readings.end(), text) == readings.end())
      readings.push_back(std::move(text));
  };
  if (name.is_uri) {
    add(percent_decoded(name.text));
    add(name.text);
    add(percent_decoded(name.text.substr(0, name.text.find('?'))));
    return readings;
  }
  add(std::string(without_quotes(name.text)));
  for (const char* mark : {" #", "\t#"})
    if (const std::size_t at = name.text.find(mark); at != std::string::npos)
      add(std::string(without_quotes(std::string_view(name.text).substr(0, at))));
  add(percent_decoded(without_quotes(name.text)));
  return readings;
}

/// `name` from `folder`, without "." and ".."; nothing when it leaves the model's folder or names none of its
/// files.
std::optional<std::string> beneath_model(std::string_view folder, std::string_view name) {
  if (name.starts_with('/') || has_scheme(name)) return std::nullopt;
  std::vector<std::string_view> parts;
  for (std::string_view path : {folder, name})
    while (!path.empty()) {
      const std::string_view part = path.substr(0, path.find('/'));
      path.remove_prefix(std::min(path.size(), part.size() + 1));
      if (part.empty() || part == ".") continue;
      if (part != "..") {
        if (parts.size() == kMostParts) return std::nullopt;
        parts.push_back(part);
      } else if (parts.empty()) {
        return std::nullopt;
      } else {
        parts.pop_back();
      }
    }
  std::string joined;
  for (const std::string_view part : parts) joined.append(joined.empty() ? "" : "/").append(part);
  const bool is_folder = name.ends_with('/') || name.ends_with("/.") || name.ends_with("/..");
  return joined.empty() || is_folder || has_scheme(joined) ? std::nullopt : std::optional(joined);
}

std::string_view last_part(std::string_view name) {
  if (name.find("://") != name.npos) name = name.substr(0, name.find_first_of("?#"));
  return name.substr(std::min(name.size(), name.find_last_of("/:") + 1));
}

class Finder {
 public:
  Finder(const NameInModel& name, Resolver& resolver, std::uint64_t max_bytes, Notes& notes,
         const std::string& place)
      : name_(name), resolver_(resolver), max_bytes_(max_bytes), notes_(notes), place_(place) {}

  NamedFile find() {
    if (is_preview_uri(name_.text) && read(name_.text)) return std::move(found_);
    for (const std::string& reading : readings_of(name_)) list(reading);
    for (const std::string& name : inside_)
      if (read(name)) return std::move(found_);
    for (const std::string& name : beside_)
      if (read(name)) {
        warn("outside-name",
             " is no name within the model's folder and is not followed; " + quote(name) + " is taken");
        return std::move(found_);
      }
    if (const auto similar = only_similar(); similar && read(similar->name)) {
      const char* what = similar->of_one_key
                             ? ", which differs in the case of letters or their composition only,"
                             : ", a picture with another ending,";
      warn(similar->of_one_key ? "similar-name" : "other-ending",
           " is not there; " + quote(similar->name) + what + " is taken");
      return std::move(found_);
    }
    if (read_moved()) return std::move(found_);
    if (found_.looked_for.empty()) found_.looked_for = "it names no file beneath the model's folder";
    if (inside_.empty() && !beside_.empty())
      found_.looked_for +=
          " beneath the model's folder, which texmesh does not leave (a ZIP archive of both "
          "folders shows it all)";
    return std::move(found_);
  }

 private:
  static void add(std::vector<std::string>& names, std::optional<std::string> name) {
    if (name && std::find(names.begin(), names.end(), *name) == names.end()) names.push_back(*name);
  }

  void list(const std::string& reading) {
    const std::string_view said_in = name_.said_in;
    const std::string_view folder = said_in.substr(0, said_in.find_last_of('/') + 1);  // npos + 1 = 0
    const std::size_t before = inside_.size();
    add(inside_, beneath_model(folder, reading));
    add(inside_, beneath_model("", reading));
    if (inside_.size() > before) return;
    add(beside_, beneath_model(folder, last_part(reading)));
    add(beside_, beneath_model("", last_part(reading)));
  }

  bool read(const std::string& name) {
    std::string refused;
    try {
      found_.bytes = resolver_.read(name, max_bytes_);
    } catch (const FileRefused& e) {
      refused = " (" + e.found() + ")";
    }
    found_.name = name;
    if (!found_.bytes)
      found_.looked_for += (found_.looked_for.empty() ? "looked for " : ", ") + quote(name) + refused;
    return found_.bytes.has_value();
  }

  /// Who moves a model often leaves its pictures behind, or puts them into a folder of their own.
  bool read_moved() {
    const std::string looked_for = found_.looked_for;
    const std::string_view said_in = name_.said_in;
    const std::string folder(said_in.substr(0, said_in.find_last_of('/') + 1));
    std::vector<std::string> moved;
    for (const auto* names : {&inside_, &beside_})
      for (const std::string& name : *names)
        for (const std::string& from : {folder, std::string()})
          for (const char* of : {"", "textures"}) add(moved, beneath_model(from + of, last_part(name)));
    std::erase_if(moved, [this](const std::string& name) {
      return std::ranges::find(inside_, name) != inside_.end() ||
             std::ranges::find(beside_, name) != beside_.end();
    });
    for (const std::string& name : moved)
      if (read(name)) return warn_of_moved();
    found_.looked_for = looked_for;
    return read_beside();
  }

  /// Sketchfab's downloads have models in source/, pictures in textures/ beside it.
  bool read_beside() {
    std::set<std::string> names;
    for (const auto* all : {&inside_, &beside_})
      for (const std::string& name : *all) names.emplace(last_part(name));
    for (const std::string& name : names) {
      found_.name = std::string(kTexturesBeside) + name;
      try {
        if ((found_.bytes = resolver_.read_beside(name, max_bytes_))) return warn_of_moved();
      } catch (const FileRefused& e) {
        found_.looked_for += ", " + quote(found_.name) + " (" + e.found() + ")";
      }
    }
    return false;
  }

  bool warn_of_moved() {
    warn("moved-file", " is not there; " + quote(found_.name) + ", a file of the same last part, is taken");
    return true;
  }

  struct Similar {
    std::string name;
    bool of_one_key;  // with a name that was looked for
  };
  std::optional<Similar> only_similar() {
    std::vector<std::string> of_one_key, others;
    for (const auto* names : {&inside_, &beside_})
      for (const std::string& name : *names)
        for (const std::string& other : resolver_.similar(name))
          add(name_key(other) == name_key(name) ? of_one_key : others, other);
    const std::vector<std::string>& similar = of_one_key.empty() ? others : of_one_key;
    if (similar.size() == 1) return Similar{similar[0], !of_one_key.empty()};
    for (const std::string& name : similar)
      found_.looked_for += (&name == &similar[0] ? "; any of these may be meant: " : ", ") + quote(name);
    return std::nullopt;
  }

  void warn(const char* code, const std::string& what) {
    add_once(notes_, Severity::kWarning, code, place_, quote(name_.text) + what);
  }

  const NameInModel& name_;
  Resolver& resolver_;
  const std::uint64_t max_bytes_;
  Notes& notes_;
  const std::string& place_;
  std::vector<std::string> inside_, beside_;  // names to try
  NamedFile found_;
};

struct Beginning {
  std::string_view magic;
  const char* what;
};

// Text in any case, blanks before it left out.
constexpr Beginning kTexts[] = {
    {"version https://git-lfs.github.com/", "a Git LFS pointer (git lfs pull fetches the file)"},
    {"/annex/objects/", "a git-annex pointer (git annex get fetches the file)"},
    {"<!doctype html", "an HTML page, as servers send in the place of a file"},
    {"<html", "an HTML page, as servers send in the place of a file"},
    {"<?xml", "an XML file"},
    {"<svg", "an SVG drawing (export it as PNG)"},
    {"outs:", "a DVC pointer (dvc pull fetches the file)"},
    {"; fbx", "an FBX file (export it as glTF)"},
    {"#usda", "a USD file (export it as glTF)"},
    {"off\n", "an OFF file (convert it to PLY)"}};

/// With the NULs in it.
template <std::size_t kSize>
constexpr std::string_view whole(const char (&magic)[kSize]) {
  return {magic, kSize - 1};
}
constexpr Beginning kBytes[] = {
    {whole("PK\3\4"), "a ZIP archive (unpack it first)"},
    {whole("\x1f\x8b"), "a gzip archive (unpack it first)"},
    {whole("7z\xbc\xaf\x27\x1c"), "a 7z archive (unpack it first)"},
    {whole("Rar!\x1a\7"), "a RAR archive (unpack it first)"},
    {whole("BZh"), "a bzip2 archive (unpack it first)"},
    {whole("\xfd"
           "7zXZ"),
     "an xz archive (unpack it first)"},
    {whole("\x28\xb5\x2f\xfd"), "a Zstandard archive (unpack it first)"},
    {whole("%PDF-"), "a PDF"},
    {whole("Kaydara FBX Binary"), "an FBX file (export it as glTF)"},
    {whole("8BPS"), "a Photoshop file (save it as PNG or TIFF)"},
    {whole("b3dm"), "a tile of 3D Tiles (take the GLB out of it: npx 3d-tiles-tools b3dmToGlb)"},
    {whole("i3dm"), "a tile of 3D Tiles (take the GLB out of it: npx 3d-tiles-tools i3dmToGlb)"},
    {whole("cmpt"), "a tile of 3D Tiles (take the GLBs out of it: npx 3d-tiles-tools cmptToGlb)"},
    {whole("pnts"), "a point cloud (3D Tiles): texmesh reads surfaces; mesh it first"},
    {whole("BLENDER"), "a Blender file (export it as glTF)"},
    {whole("PXR-USDC"), "a USD file (export it as glTF)"},
    {whole("LASF"), "a point cloud (LAS): texmesh reads surfaces; mesh it first"},
    {whole("ASTM-E57"), "a point cloud (E57): texmesh reads surfaces; mesh it first"},
    {whole("NGSP"), "Gaussian splats: texmesh reads surfaces"}};

}  // namespace

NamedFile find_file(const NameInModel& name, Resolver& resolver, std::uint64_t max_bytes, Notes& notes,
                    const std::string& place) {
  return Finder(name, resolver, max_bytes, notes, place).find();
}

bool is_preview_uri(const std::string& uri) {
  return uri.starts_with("../") && parse_entry_path(uri.substr(3)).kind == EntryKind::kPreview;
}

std::string foreign_file(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kHeadBytes = 512;
  std::string_view text = text_of(bytes.first(std::min(bytes.size(), kHeadBytes)));
  for (const Beginning& b : kBytes)
    if (text.starts_with(b.magic)) return b.what;
  if (text.size() > 11 && (text.substr(4, 7) == "ftyphei" || text.substr(4, 7) == "ftyphev"))
    return "an HEIC picture (save it as JPEG or PNG)";
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  const std::string words = lower(trim(text));
  for (const Beginning& b : kTexts)
    if (words.starts_with(b.magic)) return b.what;
  return "";
}

}  // namespace texmesh
