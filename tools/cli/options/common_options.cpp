#include "tools/cli/options/common_options.h"

#include "pipeline/io/machine/machine_share.h"
#include "stages/base/run_context.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

Option add_jobs_option(Command& c, int& jobs) {
  return c.option("-j,--jobs", jobs, "Processors to use; 0 = all (default)").integer_in(0, 1024);
}

RunContext context_of(int jobs) {
  RunContext context;
  context.threads = jobs > 0 ? jobs : machine_share().processors;
  return context;
}

void add_cache_options(Command& c, CacheChoice& cache) {
  c.option("--cache", cache.folder,
           "Cache folder (default: TEXMESH_CACHE, else the user's cache folder). A folder that cannot be "
           "made or written costs a warning, never the build")
      .value_name("DIR");
  c.flag("--no-cache", cache.off, "Compute everything and keep nothing");
}

Option add_package_argument(Command& c, std::string& package, bool urls) {
  return c
      .option("PACKAGE", package,
              urls ? "A .texmesh file, a folder that unpack made, or an http(s) URL"
                   : "A .texmesh file, or a folder that unpack made")
      .required();
}

}  // namespace texmesh
