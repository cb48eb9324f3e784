#include <sys/resource.h>

#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh {
namespace {

struct VerifyArguments {
  std::vector<std::string> packages;
  int jobs = 0;
  std::uint64_t memory_mib = 8192;
  bool json = false, quiet = false;
};

/// Mesh decoders trust counts in the data; a package from a stranger must not take the whole machine.
/// Sanitizers reserve more address space than any limit allows.
void limit_memory(std::uint64_t mib) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  rlimit limit{};
  if (mib == 0 || ::getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, static_cast<rlim_t>(mib) << 20);
  ::setrlimit(RLIMIT_AS, &limit);
#else
  (void)mib;
#endif
}

/// A package that cannot be opened is a finding of its own: the other packages are checked all the same.
VerifyReport verify_path(const std::string& path, const RunContext& context) {
  try {
    const auto store = open_store(path);
    return verify_package(*store, context);
  } catch (const Error& e) {
    VerifyReport report;
    report.findings.push_back({"readable", rule_of(e), "", e.place(), e.expected(), e.found()});
    return report;
  }
}

void print_verified(const std::string& path, const VerifyReport& r, bool quiet) {
  for (const Finding& f : r.findings) std::cout << path << ": " << printable(to_string(f)) << '\n';
  if (quiet && r.findings.empty()) return;
  std::cout << path << ": "
            << (r.findings.empty()
                    ? "ok"
                    : std::to_string(r.findings.size()) + (r.findings.size() == 1 ? " finding" : " findings"))
            << " (" << r.entries << " entries, " << grouped(r.bytes) << " bytes, " << r.meshes << " meshes, "
            << r.previews << " previews, " << r.fragments << " fragments"
            << (r.content_credential ? "; the content credential was not checked" : "") << ")\n";
}

int run_verify(const VerifyArguments& args) {
  limit_memory(args.memory_mib);
  const RunContext context = context_of(args.jobs);
  bool clean = true;
  std::vector<VerifiedPackage> all;
  for (const std::string& path : args.packages) {
    const VerifyReport report = verify_path(path, context);
    clean = clean && report.findings.empty();
    if (args.json)
      all.push_back({path, report});
    else
      print_verified(path, report, args.quiet);
  }
  if (args.json) std::cout << verify_json(all) << '\n';
  return clean ? kExitOk : kExitModelFailed;
}

}  // namespace

void add_verify_command(Command& app) {
  auto args = std::make_shared<VerifyArguments>();
  Command c = app.add("verify", "Check every byte of packages: digests, documents, meshes, images");
  c.option("PACKAGES", args->packages, ".texmesh files or unpacked folders").required();
  add_jobs_option(c, args->jobs);
  c.option("--memory-mib", args->memory_mib, "Most memory; 0 = no limit").shows_default().value_name("MIB");
  c.flag("--json", args->json, "Print one JSON object with all findings");
  c.flag("-q,--quiet", args->quiet, "Say nothing about sound packages");
  c.examples(
      "  texmesh verify out/*.texmesh\n"
      "  texmesh verify www/bust --json");
  c.notes(
      "verify decodes every mesh and every texture fragment and reports every finding. A finding names the "
      "entry, the place in the entry, what was expected, what was found and [the rule].\n"
      "A C2PA content credential (META-INF/content_credential.c2pa) is accepted and not checked.\n"
      "Exit code: 0 when all packages are sound, 1 when there is a finding, 2 usage.");
  c.on_run([args] { return run_verify(*args); });
}

}  // namespace texmesh
