#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/option_fields.h"
#include "pipeline/compile/profile.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/text_table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/debug/debug_input.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

struct DebugArguments {
  std::string input, what, output, profile;
  std::vector<std::string> settings;
  int jobs = 0, size_px = 640;
  CacheChoice cache;
  bool json = false;
};

bool is_png(const std::string& path) { return path.ends_with(".png") || path.ends_with(".PNG"); }

/// Profile first, then --set over it.
CompileOptions gather_options(const DebugArguments& args) {
  CompileOptions options;
  if (!args.profile.empty()) {
    const std::string file = profile_file(args.profile);
    const auto bytes = read_input_file(file, 1 << 20);
    read_profile(options, std::string(bytes.begin(), bytes.end()), file);
  }
  std::vector<OptionField> fields = list_options(options);
  for (const std::string& setting : args.settings) {
    const std::size_t equals = setting.find('=');
    const std::string path = setting.substr(0, equals);
    OptionField* field = find_option(fields, path);
    if (equals == std::string::npos || !field)
      throw InputError("--set", "", "STAGE.OPTION=VALUE with an option that texmesh compile --help-all lists",
                       setting);
    set_option(*field, setting.substr(equals + 1), "--set " + path);
  }
  check_options(options, "command line");
  return options;
}

void check_output(const DebugArguments& args) {
  if (!is_png(args.output) && !args.output.ends_with(".glb") && !args.output.ends_with(".GLB"))
    throw InputError("--output", "", "a name that ends in .glb (to turn it in any viewer) or .png",
                     args.output);
}

std::string hex(Srgb c) { return fmt::format("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]); }

void print_debug_json(const DebugArguments& args, const DebugLegend& legend, const Notes& notes) {
  Json stops = Json::array(), list = Json::array();
  for (const auto& [value, colour] : legend.stops)
    stops.push_back({{"value", value}, {"colour", hex(colour)}});
  for (const Note& n : notes)
    list.push_back({{"severity", n.severity == Severity::kWarning ? "warning" : "info"},
                    {"code", n.code},
                    {"place", n.place},
                    {"text", n.text}});
  Json out{{"what", args.what}, {"output", args.output}, {"quantity", legend.quantity}};
  if (legend.coloured) {
    out["unit"] = legend.unit;
    out["range"] = {legend.lo, legend.hi};
    out["logarithmic"] = legend.logarithmic;
    out["stops"] = stops;
  }
  out["remarks"] = legend.remarks;
  out["notes"] = list;
  std::cout << out.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n';
}

void print_debug_text(const DebugArguments& args, const DebugLegend& legend, const Notes& notes) {
  static const char* const kColourNames[]{"dark violet", "blue", "teal", "green", "yellow"};
  std::cout << args.output << "\n" << legend.quantity;
  if (!legend.unit.empty()) std::cout << ", " << legend.unit;
  std::cout << '\n';
  for (std::size_t k = 0; k < legend.stops.size(); ++k)
    std::cout << fmt::format("  {}  {:<11}  {}\n", hex(legend.stops[k].second), kColourNames[k % 5],
                             shortest(legend.stops[k].first, 4));
  if (legend.logarithmic) std::cout << "  (equal steps of colour are equal ratios)\n";
  for (const std::string& remark : legend.remarks) std::cout << "- " << remark << '\n';
  for (const Note& n : notes)
    if (n.severity == Severity::kWarning)
      std::cerr << "warning: " << n.code << (n.place.empty() ? "" : ": " + n.place) << ": " << n.text << '\n';
}

DebugView make_view(const DebugArguments& args, const CompileOptions& options, Notes& notes) {
  const auto what = static_cast<DebugQuantity>(std::find(kDebugNames.begin(), kDebugNames.end(), args.what) -
                                               kDebugNames.begin());
  const RunContext context = context_of(args.jobs);
  if (is_package(args.input)) return view_package(args.input, what, context);
  CompileRequest request;
  request.input = args.input;
  request.options = options;
  const std::unique_ptr<Store> store = args.cache.off
                                           ? std::make_unique<NullStore>()
                                           : open_disk_store(default_cache_folder(args.cache.folder));
  return view_input(request, what, *store, context, {}, notes);
}

void run_debug(const DebugArguments& args, const CompileOptions& options) {
  Notes notes;
  const DebugView view = make_view(args, options, notes);
  write_output_file(args.output, is_png(args.output)
                                     ? write_debug_png(view, static_cast<std::uint32_t>(args.size_px))
                                     : write_debug_glb(view));
  if (args.json)
    print_debug_json(args, view.legend, notes);
  else
    print_debug_text(args, view.legend, notes);
}

void add_debug_options(Command& c, DebugArguments& args) {
  c.option("INPUT", args.input, "A model (runs the stages that are needed, through the cache) or a package")
      .required();
  c.option(
       "--what", args.what,
       "persistence: up to which scale a vertex stays a feature. skeleton: the curve skeleton inside "
       "the shape. R: the distance to the skeleton, which errors are measured against. collapse-error: at "
       "which error a vertex was removed. fragments: the texture's grid and importance (of packages, too). atlas: "
       "the charts of the textures, thin ones red, overlaps magenta; a PNG has the textures, too (of packages, "
       "too)")
      .required()
      .one_of_explained({kDebugNames.begin(), kDebugNames.end()})
      .value_name("QUANTITY");
  c.option("-o,--output", args.output, "x.glb to turn in any viewer, or x.png for two views side by side")
      .required()
      .value_name("FILE");
  c.option("--size", args.size_px, "Side of one view of a PNG, px").integer_in(64, 4096).shows_default();
  c.option("--profile", args.profile, "JSON file of options, as for compile").value_name("FILE");
  c.option("--set", args.settings,
           "STAGE.OPTION=VALUE over the profile, as compile's --STAGE.OPTION; may be repeated")
      .value_name("OPTION=VALUE");
  add_jobs_option(c, args.jobs);
  add_cache_options(c, args.cache);
  c.flag("--json", args.json, "Print the legend as one JSON object");
}

int check_and_run_debug(const DebugArguments& args) {
  CompileOptions options;
  try {
    check_output(args);
    options = gather_options(args);
  } catch (const InputError& e) {  // what was asked for makes no sense
    std::cerr << "texmesh debug: " << e.what() << '\n';
    return kExitUsage;
  }
  run_debug(args, options);
  return kExitOk;
}

}  // namespace

void add_debug_command(Command& app) {
  auto args = std::make_shared<DebugArguments>();
  Command c = app.add("debug", "Picture what a stage computed, with a legend of its colours");
  add_debug_options(c, *args);
  c.examples(
      "  texmesh debug turtle.glb --what persistence -o turtle.png\n"
      "  texmesh debug turtle.glb --what skeleton -o turtle.glb --set skeletonization.alpha_divisor=120\n"
      "  texmesh debug turtle.texmesh --what fragments -o grid.glb --json\n"
      "  texmesh debug turtle.glb --what atlas -o atlas.png");
  c.notes(
      "Colours run from dark violet (low) over teal to yellow (high); the legend on standard output gives "
      "their values. A GLB holds the colours as vertex colours (fragments and atlas: as textures) and the skeleton as "
      "lines.\n"
      "Exit code: 0, 1 when the input cannot be shown, 2 usage, 3 internal error.");
  c.on_run([args] { return check_and_run_debug(*args); });
}

}  // namespace texmesh
