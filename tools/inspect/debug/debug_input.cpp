#include "tools/inspect/debug/debug_input.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "format/container/layout.h"
#include "pipeline/compile/artefacts.h"
#include "pipeline/graph/make_stage.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr Artefact<DebugView> kView{"debug"};

/// The stage that makes the view of a quantity from what it reads.
template <class... Read>
Stage view_stage(Inputs<Read...> read, DebugView (*view)(const Read&...)) {
  return make_stage({kView.name, 1, "what a stage computed, to look at"}, read, derived(kView), options(), {},
                    [view](const Read&... objects, const RunContext&) { return view(objects...); });
}

/// Of the mesh as the file has it: conditioning may cut it.
DebugView view_imported_atlas(const ImportedMesh& imported, const std::vector<Material>& materials,
                              const std::vector<Image>& images) {
  std::vector<AtlasImage> sides;
  for (const Image& image : images) sides.push_back({image.width_px, image.height_px, nullptr});
  return view_atlas(imported.mesh, materials, sides);
}

Stage view_stage_of(DebugQuantity what) {
  switch (what) {
    case DebugQuantity::kPersistence:
      return view_stage(inputs(kConditionedMesh, kScaleMap), view_persistence);
    case DebugQuantity::kSkeleton:
      return view_stage(inputs(kConditionedMesh, kSkeleton), view_skeleton);
    case DebugQuantity::kRadius:
      return view_stage(inputs(kConditionedMesh, kSkeleton), view_radius);
    case DebugQuantity::kCollapseError:
      return view_stage(inputs(kNestedScales), view_collapse_error);
    case DebugQuantity::kAtlas:
      return view_stage(inputs(kImportedMesh, kMaterials, kImages), view_imported_atlas);
    case DebugQuantity::kFragments:
      break;
  }
  return view_stage(inputs(kConditionedMesh, kMaterials, kImages, kFragments), view_fragments);
}

}  // namespace

DebugView view_input(const CompileRequest& request, DebugQuantity what, Store& store,
                     const RunContext& context, const StageObserver& observer, Notes& notes) {
  return *run_towards(request, view_stage_of(what), kView, store, context, observer, notes);
}

DebugView view_package(const std::string& path, DebugQuantity what, const RunContext& context) {
  if (what != DebugQuantity::kFragments && what != DebugQuantity::kAtlas) {
    const std::string name(kDebugNames[static_cast<std::size_t>(what)]);
    throw InputError(path, "--what " + name, "the model it was compiled from: a package does not hold this",
                     "a package; try: texmesh debug MODEL --what " + name + ", --what fragments or atlas");
  }
  PackageReader package(open_store(path));
  return what == DebugQuantity::kAtlas ? view_atlas(package, context) : view_fragments(package, context);
}

bool is_package(const std::string& path) {
  std::error_code ec;
  if (fs::is_directory(path, ec)) return fs::exists(fs::path(path) / kManifestPath, ec);
  std::ifstream in(path, std::ios::binary);
  char magic[4]{};
  in.read(magic, 4);
  return in.gcount() == 4 && std::equal(magic, magic + 4, "PK\x03\x04");
}

}  // namespace texmesh
