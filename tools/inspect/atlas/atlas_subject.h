#pragma once
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/import/import.h"
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

}  // namespace texmesh
