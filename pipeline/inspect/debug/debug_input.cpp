#include "pipeline/inspect/debug/debug_input.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "format/container/layout.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
using Images = std::vector<Image>;
using Materials = std::vector<Material>;

constexpr const char* kView = "debug";

std::vector<std::string> inputs_of(DebugQuantity what) {
  switch (what) {
    case DebugQuantity::kPersistence:
      return {"condition", "ssf"};
    case DebugQuantity::kSkeleton:
    case DebugQuantity::kRadius:
      return {"condition", "skeletonization"};
    case DebugQuantity::kCollapseError:
      return {"simplification"};
    case DebugQuantity::kFragments:
      break;
  }
  return {"condition", "import.materials", "import.images", "fragmentation"};
}

DebugView make_view(const StageInputs& in, DebugQuantity what) {
  switch (what) {
    case DebugQuantity::kPersistence:
      return view_persistence(in.get<ConditionedMesh>("condition"), in.get<ScaleMap>("ssf"));
    case DebugQuantity::kSkeleton:
      return view_skeleton(in.get<ConditionedMesh>("condition"), in.get<Skeleton>("skeletonization"));
    case DebugQuantity::kRadius:
      return view_radius(in.get<ConditionedMesh>("condition"), in.get<Skeleton>("skeletonization"));
    case DebugQuantity::kCollapseError:
      return view_collapse_error(in.get<NestedScales>("simplification"));
    case DebugQuantity::kFragments:
      break;
  }
  return view_fragments(in.get<ConditionedMesh>("condition"), in.get<Materials>("import.materials"),
                        in.get<Images>("import.images"), in.get<Fragments>("fragmentation"));
}

}  // namespace

DebugView view_input(const CompileRequest& request, DebugQuantity what, Store& store,
                     const RunContext& context, const StageObserver& observer, Notes& notes) {
  Stage view;
  view.name = kView;
  view.inputs = inputs_of(what);
  view.outputs = {{kView, nullptr, nullptr}};
  view.stored = false;
  view.run = [what](const StageInputs& in) { return StageOutputs{{object(make_view(in, what))}, {}}; };
  const std::vector<Stage> graph = graph_towards(std::move(view));
  const Object result = run_stages(request, graph, kView, store, context, observer, notes);
  return *static_cast<const DebugView*>(result.get());
}

DebugView view_package(const std::string& path, DebugQuantity what, const RunContext& context) {
  if (what != DebugQuantity::kFragments) {
    const std::string name(kDebugNames[static_cast<std::size_t>(what)]);
    throw InputError(path, "--what " + name, "the model it was compiled from: a package does not hold this",
                     "a package; try: texmesh debug MODEL --what " + name + ", or --what fragments");
  }
  PackageReader package(open_store(path));
  return view_fragments(package, context);
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
