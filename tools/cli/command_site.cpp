#include <filesystem>

#include "format/documents/about.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/publish/site/site.h"
#include "tools/publish/view/served_files.h"

namespace texmesh {
namespace {

struct SiteArguments {
  std::string packages, folder, viewer;
  SiteOptions options;
  bool json = false;
};

int run_site(SiteArguments& args) {
  SiteOptions& options = args.options;
  if (!options.packages_url.empty() && !is_web_url(options.packages_url))
    throw UsageError("--packages-url", "", "an http or https URL", options.packages_url);
  if (!options.packages_url.empty() && !options.packages_url.ends_with("/")) options.packages_url += "/";
  options.viewer = viewer_folder(args.viewer);
  check_site_folder(args.folder);  // not after the work
  const Site site = read_site(args.packages, options);
  for (const SiteFault& f : site.faults) std::cerr << "texmesh: " << printable(f.message) << '\n';
  write_site(site, args.folder);
  if (args.json)
    std::cout << site_json(site, args.folder) << '\n';
  else
    std::cout << (std::filesystem::path(args.folder) / "index.html").string() << ", " << site.objects.size()
              << (site.objects.size() == 1 ? " object\n" : " objects\n");
  return site.faults.empty() ? kExitOk : kExitModelFailed;
}

}  // namespace

void add_site_command(Command& app) {
  auto args = std::make_shared<SiteArguments>();
  Command c = app.add("site", "Write a static site of a collection: posters, search, licences, a viewer");
  c.option("PACKAGES", args->packages, "A folder of packages, whose folders are looked into; or one package")
      .required();
  c.option(
       "-o,--output", args->folder,
       "The folder to make, with index.html in it. An earlier site is replaced; any other folder with files "
       "is refused")
      .required()
      .value_name("DIR");
  c.option("--title", args->options.title, "Title of the collection").shows_default().value_name("TEXT");
  c.option("--packages-url", args->options.packages_url,
           "URL of a folder on the web that has the same packages as PACKAGES (default: site copies them)")
      .value_name("URL");
  c.option("--viewer", args->viewer, "Folder with the built viewer, instead of the viewer of this build")
      .value_name("DIR");
  c.flag("--json", args->json, "Print one JSON object (schemas/site.v1.schema.json)");
  c.examples(
      "  texmesh site packages/ -o www/\n"
      "  texmesh site packages/ -o www/ --title \"Casts\" --packages-url https://files.museum.example/casts/");
  c.notes(
      "The site has a list with posters, creators, licences and sizes, which visitors can search. Each object "
      "has a page, which loads the viewer when somebody asks for it. The files are static: any web server "
      "can serve them from any folder. They ask other servers for packages at --packages-url alone. That "
      "server must allow pages of others to read ranges (CORS). If you open the files without a server, "
      "browsers show the list but no object in 3D.\n"
      "If a package cannot be read, site leaves it out and says so.\n"
      "Exit code: 0, 1 when a package could not be read (the site has the others) or DIR not be written, "
      "2 usage.");
  c.on_run([args] { return run_site(*args); });
}

}  // namespace texmesh
