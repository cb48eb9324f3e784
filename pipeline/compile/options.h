#pragma once
#include <set>
#include <typeinfo>

#include "pipeline/graph/stage.h"
#include "pipeline/import/import.h"
#include "stages/atlas/atlas.h"
#include "stages/atlas_choice/atlas_choice.h"
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
/// {"ssf":{"scales":..}} and --ssf.scales.
struct CompileOptions {
  ImportOptions import;
  ConditionOptions condition;
  AtlasOptions atlas;
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
  static void sections(auto& s, auto&& f) {
    f("import", s.import);
    f("condition", s.condition);
    f("atlas", s.atlas);
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
/// - ladder.uncovered is kept with fragmentation.fill none: the source's own texels stay, at any cost. So it
///   is with atlas.mode rebuild, whose gutters are small: what lies in them shows in coarser mips.
/// - simplification.seam_weight is .1 with atlas.mode rebuild, whose few seams lie where nobody made them.
/// - proxies.mode is always with atlas.mode rebuild, whose scales auto takes for better than they are.
/// - package.meta gets its canonical text.
/// - ladder.prune is false where rungs of any role are given: every rung that is asked for is stored.
/// A field that the user has set stays as it is, and so does a field that differs from its default. Resolved
/// options resolve to themselves. Keys, provenance and workers' jobs hold resolved options.
CompileOptions resolve_options(CompileOptions options);

/// Checks that go beyond one field (rungs strictly rising, quality_min <= quality_max ...). InputError.
void check_options(const CompileOptions& options, const std::string& source);

enum class OptionKind : std::uint8_t { kSwitch, kInteger, kNumber, kText, kIntegers, kNumbers, kName };

/// One option as generic code sees it. The functions reach into the CompileOptions that list_options was
/// given.
struct OptionField {
  std::string stage, name, help;
  std::optional<Range> range;
  bool has_flag = true;  // false: profiles alone may set it (ProfileOnly)
  OptionKind kind = OptionKind::kText;
  std::span<const std::string_view> words;  // kName: one of these
  std::function<void(Json&to)> put, put_schema;
  std::function<void(const Json& from, const RecordPlace& at)> get;
  std::set<std::string>* set_by_user = nullptr;  // of the same CompileOptions; set_option() adds the path
  std::string path() const { return stage + "." + name; }
};
std::vector<OptionField> list_options(CompileOptions& options);

/// The field with this path, or null.
OptionField* find_option(std::vector<OptionField>& fields, std::string_view path);

/// A field's value as JSON, and its text: what keys, provenance and --explain compare.
Json option_json(const OptionField& field);
std::string option_text(const OptionField& field);

/// Sets a field. Strict: a wrong type or a value out of range throws InputError{file, place, ...}.
void set_option_json(OptionField& field, const Json& json, const std::string& file, const std::string& place);
/// Sets a field from text as given on a command line ("20", "draco", "5,8,11"). InputError names the flag.
void set_option(OptionField& field, const std::string& text, const std::string& source);

/// The name of a part of `all`: "ssf" of a section, "ladder.mode" of a field. Throws std::logic_error for
/// what is no part of it. The type tells a section from its first field, which stands at the same place.
std::string option_name(const CompileOptions& all, const void* part, const std::type_info& type);
template <class T>
std::string option_name(const CompileOptions& all, const T& part) {
  return option_name(all, &part, typeid(T));
}

/// Declares what a stage reads of `all`: whole sections or single fields, as they stand there.
template <class... T>
Options<T...> read_of(const CompileOptions& all, const T&... parts) {
  return options(OptionValue<T>(option_name(all, parts), parts)...);
}

/// Reads a profile (schemas/profile.v1.schema.json) over the given options; absent fields keep their values,
/// those that it has count as set by the user. Strict: unknown fields, wrong types and values out of range
/// throw InputError{file_name, JSON pointer, ...}.
void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name);
/// The same for a profile that is parsed already.
void apply_profile(CompileOptions& options, const Json& profile, const std::string& file_name);

/// The file of a profile: `wanted` where there is such a file or it has a slash or a dot, else NAME.json of
/// profiles/ beside the executable's folder (a build tree) or of share/texmesh/profiles of an installation.
/// InputError with the names that there are.
std::string profile_file(const std::string& wanted);

/// Every option as a profile. Of resolved options: what provenance records, and what a worker gets. With
/// atlas.mode auto write_profile() leaves out defaults that nobody has set, since the choice may change them.
std::string write_profile(const CompileOptions& options);
Json profile_json(const CompileOptions& options);

/// The JSON schema of profiles, generated from the fields: profile.v1.
DocumentSchema profile_schema();

/// Reads a JND profile (schemas/jnd-profile.v1.schema.json): what an experiment with judges found to be just
/// noticeable, and under which conditions. Its numbers become the options perceptual_values.jnd,
/// .jnd_reference_px, .jnd_distance_exponent and .statistic, so they are in keys and provenance and the file
/// itself is not. Absent ones keep their values, but for the exponent: a profile that says nothing of
/// distance holds at every distance (0), as the thesis prints. Strict: an unknown field, a wrong type, a
/// value out of range is an InputError {file, JSON pointer, ...}; then no option has changed.
void read_jnd_profile(CompileOptions& options, ByteSpan json, const std::string& file);

/// jnd-profile.v1.
DocumentSchema jnd_profile_schema();

}  // namespace texmesh
