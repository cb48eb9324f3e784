#include "pipeline/compile/options.h"

#include "format/container/layout.h"
#include "pipeline/about/meta.h"
#include "pipeline/graph/option_text.h"

namespace texmesh {
namespace {

void check_proxies(const std::vector<int>& sizes, const std::string& source) {
  if (sizes.size() > kMaxPackageProxies)
    throw InputError(source, "proxies.sizes", "at most " + std::to_string(kMaxPackageProxies) + " sizes",
                     std::to_string(sizes.size()));
  for (std::size_t i = 1; i < sizes.size(); ++i)
    if (sizes[i] <= sizes[i - 1])
      throw InputError(source, "proxies.sizes", "strictly rising sizes",
                       std::to_string(sizes[i - 1]) + " before " + std::to_string(sizes[i]));
}

void check_rungs(const std::vector<int>& rungs, const std::string& source, const char* name) {
  if (rungs.size() > 16) throw InputError(source, name, "at most 16 qualities", std::to_string(rungs.size()));
  for (std::size_t i = 1; i < rungs.size(); ++i)
    if (rungs[i] <= rungs[i - 1])
      throw InputError(source, name, "strictly rising qualities",
                       std::to_string(rungs[i - 1]) + " before " + std::to_string(rungs[i]));
}

void check_meta(const CompileOptions& o, const std::string& source) {
  if (o.package.meta.empty()) return;
  read_meta(o.package.meta, source, "package.meta");
  const std::string up = up_axis_of_meta(o.package.meta);
  if (o.import.up != UpAxis::kKeep && !up.empty() && up != "y")
    throw InputError(source, "package.meta/upAxis", "y, as import.up has it, or no upAxis", up);
}

}  // namespace

CompileOptions resolve_options(CompileOptions o) {
  const auto is_default = [&](const char* path, const auto& value, const auto& fallback) {
    return value == fallback && !o.set_by_user.contains(path);
  };
  if (o.ladder.mode == LadderMode::kProgressive &&
      is_default("fragmentation.min_fragment_px", o.fragmentation.min_fragment_px,
                 FragmentationOptions{}.min_fragment_px))
    o.fragmentation.min_fragment_px = static_cast<int>(kLeastProgressiveSide);
  if (o.fragmentation.fill == Fill::kNone &&
      is_default("ladder.uncovered", o.ladder.uncovered, LadderOptions{}.uncovered))
    o.ladder.uncovered = Uncovered::kKept;
  if (!o.package.meta.empty()) o.package.meta = read_meta(o.package.meta, "package.meta");
  const LadderOptions usual;
  if (is_default("ladder.prune", o.ladder.prune, usual.prune))
    o.ladder.prune = is_default("ladder.rungs", o.ladder.rungs, usual.rungs) &&
                     is_default("ladder.normal_rungs", o.ladder.normal_rungs, usual.normal_rungs) &&
                     is_default("ladder.data_rungs", o.ladder.data_rungs, usual.data_rungs) &&
                     is_default("ladder.alpha_rungs", o.ladder.alpha_rungs, usual.alpha_rungs);
  return o;
}

void check_options(const CompileOptions& o, const std::string& source) {
  check_meta(o, source);
  check_proxies(o.proxies.sizes, source);
  check_rungs(o.ladder.rungs, source, "ladder.rungs");
  check_rungs(o.ladder.normal_rungs, source, "ladder.normal_rungs");
  check_rungs(o.ladder.data_rungs, source, "ladder.data_rungs");
  check_rungs(o.ladder.alpha_rungs, source, "ladder.alpha_rungs");
  if (o.lut.quality_min > o.lut.quality_max)
    throw InputError(source, "lut.quality_min", "<= lut.quality_max (" + option_text(o.lut.quality_max) + ")",
                     option_text(o.lut.quality_min));
  if (o.lut.quality_fine < o.lut.quality_coarse)
    throw InputError(source, "lut.quality_fine",
                     ">= lut.quality_coarse (" + option_text(o.lut.quality_coarse) + ")",
                     option_text(o.lut.quality_fine));
  if (!(o.zim.weight_eta + o.zim.weight_z + o.zim.weight_i + o.zim.weight_m > 0))
    throw InputError(source, "zim.weight_eta", "> 0, or weight_z, weight_i or weight_m > 0",
                     option_text(o.zim.weight_eta));
}

}  // namespace texmesh
