#pragma once
#include <set>
#include <string>

#include "pipeline/import/import.h"
#include "stages/condition/condition.h"
#include "stages/fragmentation/fragmentation.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/package/package.h"
#include "stages/perceptual_values/perceptual_values.h"
#include "stages/poster/poster.h"
#include "stages/proxies/proxies.h"
#include "stages/quality/quality.h"
#include "stages/scales/scales.h"
#include "stages/simplification/simplification.h"
#include "stages/skeletonization/skeletonization.h"
#include "stages/ssf/ssf.h"
#include "stages/zim/zim.h"

namespace texmesh {

/// Every option that can change a package, by stage. A profile file, the command line, the cache keys,
/// provenance and `dump` all speak of these fields under the same names: `ssf.scales` is
/// {"ssf":{"scales":..}} and --ssf.scales. The generic view of the fields is in option_fields.h, JSON in
/// profile.h.
struct CompileOptions {
  ImportOptions import;
  ConditionOptions condition;
  SkeletonizationOptions skeletonization;
  SsfOptions ssf;
  SimplificationOptions simplification;
  PerceptualValuesOptions perceptual_values;
  FragmentationOptions fragmentation;
  ZimOptions zim;
  LadderOptions ladder;
  LutOptions lut;
  ScalesOptions scales;
  QualityOptions quality;
  PosterOptions poster;
  ProxiesOptions proxies;
  PackageOptions package;

  /// Paths of the fields that a profile or a flag has set, to whatever value: resolve_options() leaves them
  /// alone.
  std::set<std::string> set_by_user;

  /// Calls f(stage name, options struct) for every stage, in the order of the graph.
  template <class S, class F>
  static void sections(S& s, F&& f) {
    f("import", s.import);
    f("condition", s.condition);
    f("skeletonization", s.skeletonization);
    f("ssf", s.ssf);
    f("simplification", s.simplification);
    f("perceptual_values", s.perceptual_values);
    f("fragmentation", s.fragmentation);
    f("zim", s.zim);
    f("ladder", s.ladder);
    f("lut", s.lut);
    f("scales", s.scales);
    f("quality", s.quality);
    f("poster", s.poster);
    f("proxies", s.proxies);
    f("package", s.package);
  }
};

/// The options that the stages use. Defaults that depend on other options get their values here:
/// - fragmentation.min_fragment_px is kLeastProgressiveSide with ladder.mode progressive.
/// - ladder.uncovered is kept with fragmentation.fill none: the source's own texels stay, at any cost.
/// - package.meta gets its canonical text.
/// - ladder.prune is false where rungs of any role are given: every rung that is asked for is stored.
/// A field that the user has set stays as it is, and so does a field that differs from its default. Resolved
/// options resolve to themselves. Keys, provenance and workers' jobs hold resolved options.
CompileOptions resolve_options(CompileOptions options);

/// Checks that go beyond one field (rungs strictly rising, quality_min <= quality_max ...). InputError.
void check_options(const CompileOptions& options, const std::string& source);

}  // namespace texmesh
