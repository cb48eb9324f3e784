#include <filesystem>
#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"
#include "tools/cli/check/check_gate.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/package_mesh.h"

namespace texmesh {
namespace {

struct DoctorArguments {
  std::string input, junit;
  AtlasLimits limits;
  int jobs = 0;
  bool json = false;
};

AtlasDiagnosis diagnose_input(const std::string& path, const RunContext& context) {
  if (!is_package(path)) {
    const auto subject = atlas_subject(path, context);
    for (const Note& n : subject.notes)
      if (n.severity == Severity::kWarning) std::cerr << "warning: " << n.code << ": " << n.text << '\n';
    return diagnose_atlases(subject, context);
  }
  PackageReader package(open_store(path));
  return diagnose_atlases(atlas_subject(package, context), context);
}

int run_doctor(const DoctorArguments& args) {
  const AtlasDiagnosis diagnosis = diagnose_input(args.input, context_of(args.jobs));
  const std::vector<GateResult> results = check_atlases(diagnosis, args.limits);
  if (!args.junit.empty()) write_gate_junit(args.junit, "texmesh doctor", args.input, results);
  const std::vector<std::string> reasons = gate_failures(results);
  const std::string name = std::filesystem::path(args.input).filename().string();
  if (args.json) {
    std::cout << json_line(doctor_json({name, diagnosis, reasons})) << '\n';
  } else {
    std::cout << printable(name) << "\n" << atlas_text(diagnosis);
    for (const std::string& r : reasons) std::cout << "not good enough: " << r << '\n';
    if (!results.empty() && reasons.empty()) std::cout << "good enough\n";
  }
  return reasons.empty() ? kExitOk : kExitDifferent;
}

void add_limits(Command& c, AtlasLimits& limits) {
  c.group("Limits (exit code 4 beyond one)");
  c.option(
       "--max-charts", limits.max_charts,
       "Largest number of charts of the model. Some 20 to 300 are usual for a scan that was unwrapped with "
       "care")
      .number_in(0, 1e9);
  c.option("--max-floor", limits.max_floor_triangles,
           "Largest number of triangles that the coarsest mesh with all charts needs; 8 bytes each")
      .number_in(0, 1e9);
  c.option("--min-cover", limits.min_cover, "Least share of each texture that is shown, 0 to 1")
      .number_in(0, 1);
  c.option("--max-thin", limits.max_thin,
           "Largest share of a texture's shown texels in charts thinner than 8 texels, 0 to 1")
      .number_in(0, 1);
  c.option("--max-overlap", limits.max_overlap,
           "Largest share of the shown texels that two places of the surface show, 0 to 1")
      .number_in(0, 1);
  c.option("--max-flat", limits.max_flat,
           "Largest share of the surface that has no area on the texture, 0 to 1")
      .number_in(0, 1);
  c.option("--max-density-spread", limits.max_density_spread,
           "Largest ratio of texels per length between the finest and the coarsest twentieth of the surface")
      .number_in(1, 1e9);
  c.option("--max-stretch", limits.max_stretch,
           "Largest ratio of a texel's length to its width, on 95 % of the surface; 1 = square everywhere")
      .number_in(1, 1e9);
  c.option("--max-seam-difference", limits.max_seam_difference,
           "Largest difference of colours across seams, in the mean (CIE 1976; 2.3 can just be seen)")
      .number_in(0, 1000);
}

}  // namespace

void add_doctor_command(Command& app) {
  auto args = std::make_shared<DoctorArguments>();
  Command c = app.add("doctor", "Say what a model's texture atlas costs and what to do: a gate for CI, too");
  c.option("INPUT", args->input,
           "A model that compile takes, or a package: a .texmesh file or a folder that unpack made")
      .required();
  add_jobs_option(c, args->jobs);
  c.flag("--json", args->json, "Print one JSON object (schemas/doctor.v1.schema.json)");
  c.option("--junit", args->junit, "Write a test case for every limit as JUnit XML").value_name("FILE");
  add_limits(c, args->limits);
  c.examples(
      "  texmesh doctor scan.glb                                      figures and what to do\n"
      "  texmesh doctor scan.glb --max-charts 500 --min-cover 0.5     refuses a bad atlas in CI\n"
      "  texmesh doctor scan.texmesh --json                           the same of a package's finest scale\n"
      "  texmesh render scan.glb --what atlas -o atlas.png            the charts as a picture");
  c.notes(
      "An atlas is a texture with the charts that a surface is cut into. Every chart has borders that no "
      "simplified mesh can give up. So no program makes a small coarse mesh of an atlas of thousands of "
      "charts. docs/atlas.md explains the figures.\n"
      "A model without textures or texture coordinates has no atlas: doctor says so, and every limit is "
      "kept.\n"
      "Exit code: 0, 4 beyond a limit, 1 when the input cannot be read, 2 usage, 3 internal error.");
  c.on_run([args] { return run_doctor(*args); });
}

}  // namespace texmesh
