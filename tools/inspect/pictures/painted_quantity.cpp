#include "tools/inspect/pictures/painted_quantity.h"

#include "pipeline/compile/stage_table.h"

namespace texmesh {
namespace {

/// Of the mesh as the file has it: conditioning may cut it.
PaintedModel paint_imported_atlas(const ImportedMesh& imported, const std::vector<Material>& materials,
                                  const std::vector<Image>& images) {
  std::vector<AtlasImage> sides;
  for (const Image& image : images) sides.push_back({image.width_px, image.height_px, nullptr});
  return paint_atlas(imported.mesh, materials, sides);
}

constexpr PaintedQuantity kQuantities[] = {
    {"atlas", [] { return painting_stage(inputs(kImportedMesh, kMaterials, kImages), paint_imported_atlas); },
     paint_atlas},
    {"fragments",
     [] {
       return painting_stage<ConditionedMesh, std::vector<Material>, std::vector<Image>, Fragments>(
           inputs(kConditionedMesh, kMaterials, kImages, kFragments), paint_fragments);
     },
     paint_fragments},
    {"scales", [] { return painting_stage(inputs(kConditionedMesh, kScaleMap), paint_scales); }, nullptr}};

}  // namespace

std::span<const PaintedQuantity> painted_quantities() { return kQuantities; }

PaintedModel paint_model(const CompileRequest& request, const PaintedQuantity& what, Store& store,
                         const RunContext& context, const StageObserver& observer, Notes& notes) {
  return *run_towards(request, what.stage(), kPainted, store, context, observer, notes);
}

PaintedModel paint_package(const std::string& path, const PaintedQuantity& what, const RunContext& context) {
  if (!what.of_package)
    throw InputError(path, "--what " + std::string(what.name),
                     "the model it was compiled from: a package does not hold this", "a package");
  PackageReader package(open_store(path));
  return what.of_package(package, context);
}

}  // namespace texmesh
