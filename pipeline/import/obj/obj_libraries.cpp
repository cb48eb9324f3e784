#include "pipeline/import/obj/obj_libraries.h"

#include <algorithm>
#include <map>
#include <optional>

#include "pipeline/import/mesh_builder.h"
#include "pipeline/import/obj/obj_material.h"
#include "pipeline/import/text_scan.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

struct LoadedLibrary {
  std::string name;
  MtlFile file;
  std::map<std::string, std::size_t> by_name;  // the first material so named

  LoadedLibrary(std::string library_name, MtlFile library_file)
      : name(std::move(library_name)), file(std::move(library_file)) {
    for (std::size_t i = 0; i < file.materials.size(); ++i) by_name.try_emplace(file.materials[i].name, i);
  }
};

std::optional<LoadedLibrary> load_library(std::string name, const std::string& file, const std::string& place,
                                          Model& model, Resolver& resolver, const ImportOptions& options) {
  std::replace(name.begin(), name.end(), '\\', '/');
  check_relative_name(name, file, place);
  const auto bytes = resolver.read(name, static_cast<std::uint64_t>(options.max_file_bytes));
  if (!bytes) return std::nullopt;
  return LoadedLibrary(name, read_mtl(name, *bytes, model.notes));
}

/// `mtllib a.mtl b.mtl` names two files, `mtllib my scan.mtl` one: the whole is tried first.
void load_libraries(const ObjData::Library& library, const std::string& file, Model& model,
                    Resolver& resolver, const ImportOptions& options, std::vector<LoadedLibrary>& loaded) {
  const std::string place = "line " + std::to_string(library.line);
  auto load = [&](const std::string& name) {
    auto found = load_library(name, file, place, model, resolver, options);
    if (found) loaded.push_back(std::move(*found));
    return found.has_value();
  };
  auto missing = [&](const std::string& name) {
    add_warning(model.notes, "missing-mtl", place,
                "material library " + name + " not found; its materials stay untextured");
  };
  if (library.name.empty() || load(library.name)) return;
  std::string_view rest = library.name;
  const std::string first(next_token(rest));
  if (trim(rest).empty()) return missing(library.name);
  bool any = false;
  std::vector<std::string> absent;
  rest = library.name;
  for (std::string_view token = next_token(rest); !token.empty(); token = next_token(rest)) {
    if (load(std::string(token)))
      any = true;
    else
      absent.emplace_back(token);
  }
  if (!any) return missing(library.name);
  for (const std::string& name : absent) missing(name);
}

Material make_material(const std::string& name, const std::vector<LoadedLibrary>& libraries, bool any_library,
                       const std::string& file, Model& model, Resolver& resolver,
                       const ImportOptions& options) {
  for (const LoadedLibrary& library : libraries)
    if (const auto it = library.by_name.find(name); it != library.by_name.end())
      return material_from_mtl(library.file.materials[it->second], library.file, library.name, model,
                               resolver, options);
  if (!libraries.empty())
    add_warning(model.notes, "missing-material", file,
                "material " + quote(name) + " is in no material library");
  else if (!any_library)
    add_warning(model.notes, "missing-material", file,
                "material " + quote(name) + " is used but no mtllib names a library");
  return scan_material(name);
}

}  // namespace

void add_obj_materials(const ObjData& data, const std::string& file, Model& model, Resolver& resolver,
                       const ImportOptions& options) {
  std::vector<LoadedLibrary> libraries;
  for (const ObjData::Library& library : data.libraries) {
    const auto same = [&library](const ObjData::Library& other) { return other.name == library.name; };
    const auto first = std::find_if(data.libraries.begin(), data.libraries.end(), same);
    if (&*first == &library) load_libraries(library, file, model, resolver, options, libraries);
  }
  std::vector<std::uint8_t> used(data.materials.size(), 0);
  for (const ObjFace& f : data.faces) used[f.material] = 1;
  for (std::size_t i = 0; i < data.materials.size(); ++i) {
    // Textures of materials without faces are never asked for.
    const bool named = used[i] && !(i == 0 && data.materials[0].empty());
    model.materials.push_back(named ? make_material(data.materials[i], libraries, !data.libraries.empty(),
                                                    file, model, resolver, options)
                                    : scan_material(i == 0 ? "untextured" : data.materials[i]));
  }
}

}  // namespace texmesh
