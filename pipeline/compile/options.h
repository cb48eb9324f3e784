#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "format/base/fields.h"
#include "pipeline/import/import.h"
#include "stages/condition/condition.h"
#include "stages/fragmentation/fragmentation.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/package/package.h"
#include "stages/perceptual_values/perceptual_values.h"
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
  PackageOptions package;

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
    f("package", s.package);
  }
};

/// A field whose C++ type is an enum, seen as text.
struct EnumField {
  std::span<const std::string_view> names;
  std::function<std::size_t()> get;
  std::function<void(std::size_t)> set;
};

/// One option as the generic code sees it. Pointers lead into the CompileOptions that list_options was given.
struct OptionField {
  std::string stage, name, help;
  std::optional<Range> range;
  std::variant<bool*, int*, double*, std::string*, std::vector<int>*, std::vector<double>*, EnumField> value;
  std::string path() const { return stage + "." + name; }
};
std::vector<OptionField> list_options(CompileOptions& options);

/// Text of a field's value as JSON, after defaults: what keys, provenance and --explain compare.
std::string option_text(const OptionField& field);

/// Sets a field from text as given on a command line ("20", "draco", "5,8,11"). InputError names the flag.
void set_option(OptionField& field, const std::string& text, const std::string& source);

/// Reads a profile (schemas/profile.v1.schema.json) over the given options; absent fields keep their values.
/// Strict: unknown fields, wrong types and values out of range throw InputError{file_name, JSON pointer,
/// ...}.
void read_profile(CompileOptions& options, const std::string& json, const std::string& file_name);

/// Every option, after defaults, as a profile: what provenance records.
std::string write_profile(const CompileOptions& options);

/// The JSON schema of profiles, generated from the fields; schemas/profile.v1.schema.json is this text (a
/// test).
std::string profile_schema();

/// Checks that go beyond one field (rungs strictly rising, quality_min <= quality_max ...). InputError.
void check_options(const CompileOptions& options, const std::string& source);

}  // namespace texmesh
