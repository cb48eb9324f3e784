#include "tools/cli/painting.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"
#include "tools/inspect/package_mesh.h"

namespace texmesh {

template <>
struct RecordFields<LegendStop> {
  static void fields(auto& s, auto&& v) {
    v("value", s.value, "");
    v("colour", hex_of(s.colour), "");
  }
};

namespace {

/// What --json prints. Range, stops and the rest of the scale of colours are left out where there is none.
struct PaintedDocument {
  const Painting& painting;
  const ColourLegend& legend;
  const Notes& notes;
  static void fields(auto& s, auto&& v) {
    v("what", s.painting.what, "");
    v("output", s.painting.output, "");
    v("quantity", s.legend.quantity, "");
    if (s.legend.coloured) {
      v("unit", s.legend.unit, "");
      v("range", std::array{s.legend.lo, s.legend.hi}, "");
      v("logarithmic", s.legend.logarithmic, "");
      v("stops", s.legend.stops, "");
    }
    v("remarks", s.legend.remarks, "");
    v("notes", s.notes, "");
  }
};

/// Profile first, then --set over it.
CompileOptions options_of(const Painting& p) {
  CompileOptions options;
  apply_profile(p.profile, options);
  std::vector<OptionField> fields = list_options(options);
  for (const std::string& setting : p.settings) {
    const std::size_t equals = setting.find('=');
    const std::string path = setting.substr(0, equals);
    OptionField* field = find_option(fields, path);
    if (equals == std::string::npos || !field)
      throw UsageError("--set", "",
                       "STAGE.OPTION=VALUE with an option of profiles (texmesh schema profile.v1)", setting);
    set_option(*field, setting.substr(equals + 1), "--set " + path);
  }
  check_options(options, "command line");
  return options;
}

bool ends_with_either(const std::string& path, const char* ending, const char* large) {
  return path.ends_with(ending) || path.ends_with(large);
}

PaintedModel paint(const Painting& p, const PaintedQuantity& what, Notes& notes) {
  CompileRequest request;
  request.input = p.input;
  request.options = as_usage([&] { return options_of(p); });
  const RunContext context = context_of(p.jobs);
  if (is_package(p.input)) return paint_package(p.input, what, context);
  return paint_model(request, what, *store_of(p.cache), context, {}, notes);
}

void print_legend(const Painting& p, const ColourLegend& legend, const Notes& notes) {
  std::cout << p.output << "\n" << legend.quantity;
  if (!legend.unit.empty()) std::cout << ", " << legend.unit;
  std::cout << '\n';
  for (const LegendStop& stop : legend.stops)
    std::cout << fmt::format("  {}  {:<11}  {}\n", hex_of(stop.colour), stop.name, shortest(stop.value));
  if (legend.logarithmic) std::cout << "  (equal steps of colour are equal ratios)\n";
  for (const std::string& remark : legend.remarks) std::cout << "- " << remark << '\n';
  print_warnings(notes);
}

}  // namespace

void add_painting_options(Command& c, Painting& painting) {
  c.option("--profile", painting.profile, "JSON file of options, as for compile", "FILE");
  c.option("--set", painting.settings, "STAGE.OPTION=VALUE over the profile; may be repeated",
           "OPTION=VALUE");
  add_cache_options(c, painting.cache);
}

int run_painting(const Painting& p, std::span<const PaintedQuantity> quantities) {
  const bool png = ends_with_either(p.output, ".png", ".PNG");
  const bool csv = ends_with_either(p.output, ".csv", ".CSV"),
             ply = ends_with_either(p.output, ".ply", ".PLY");
  if (!png && !csv && !ply && !ends_with_either(p.output, ".glb", ".GLB"))
    throw UsageError("--output", "",
                     "a name that ends in .glb (to turn it in any viewer), .png, .csv or .ply", p.output);
  Notes notes;
  const auto what = std::ranges::find(quantities, std::string_view(p.what), &PaintedQuantity::name);
  const PaintedModel model = paint(p, *what, notes);
  write_output_file(p.output, csv   ? text_bytes(write_painted_csv(model, p.what))
                              : ply ? text_bytes(write_painted_ply(model, p.what))
                              : png ? write_painted_png(model, static_cast<std::uint32_t>(p.size_px))
                                    : write_painted_glb(model));
  if (p.json)
    std::cout << to_json_line(PaintedDocument{p, model.legend, notes}) << '\n';
  else
    print_legend(p, model.legend, notes);
  return kExitOk;
}

}  // namespace texmesh
