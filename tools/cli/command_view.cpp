#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "pipeline/io/uri.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/publish/view/view_server.h"

namespace texmesh {
namespace {

struct ViewArguments {
  std::string package, viewer, host = "127.0.0.1";
  int port = 0;
  bool open = false, json = false;
};

std::string url_host(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
}

void announce(const ViewArguments& args, const ServedFiles& files, const std::string& base) {
  const std::vector<std::string> packages = files.packages();
  // The package's path is encoded twice: the page decodes the query before it takes the value for a URL.
  const std::string page = packages.size() == 1 ? base + "?pkg=" + percent_encoded(packages[0]) : base;
  if (args.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const std::string& p : packages) list.push_back(base + p);
    std::cout << nlohmann::ordered_json{{"version", 1}, {"url", page}, {"packages", list}}.dump()
              << std::endl;
  } else {
    std::cout << page << "\nserving " << packages.size() << (packages.size() == 1 ? " package" : " packages")
              << "; Ctrl-C ends it" << std::endl;
  }
  if (!args.open) return;
  if (::fork() == 0) {
    ::execlp("xdg-open", "xdg-open", page.c_str(), nullptr);
    ::_exit(127);
  }
}

void view(const ViewArguments& args) {
  const ServedFiles files(args.package, viewer_folder(args.viewer));
  ViewServer server(files);
  const int port = server.bind(args.host, args.port);
  sigset_t ends;
  sigemptyset(&ends);
  for (const int s : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ends, s);
  ::pthread_sigmask(SIG_BLOCK, &ends, nullptr);  // before there are threads, so that none of them takes it
  std::thread serving([&server] { server.serve(); });
  announce(args, files, "http://" + url_host(args.host) + ":" + std::to_string(port) + "/");
  int signal = 0;
  ::sigwait(&ends, &signal);
  // Without a stop: connections that browsers keep open would hold the library's threads for seconds. Nothing
  // here needs an end.
  ::_exit(kExitOk);
}

}  // namespace

void add_view_command(Command& app) {
  auto args = std::make_shared<ViewArguments>();
  Command c = app.add("view", "Look at packages in a browser: serves the packages and the viewer");
  c.option("PACKAGE", args->package,
           "A .texmesh file, a folder that unpack made, or a folder of packages to choose from")
      .required();
  c.option("--host", args->host,
           "Address to listen on; an address other than this machine's own lets other machines in")
      .shows_default()
      .value_name("ADDRESS");
  c.option("--port", args->port, "Port; 0 = any free port").integer_in(0, 65535).shows_default();
  c.option("--viewer", args->viewer, "Folder with the built viewer, instead of the viewer of this build")
      .value_name("DIR");
  c.flag("--open", args->open, "Open the page with xdg-open");
  c.flag("--json", args->json, "Print one JSON object with the URLs");
  c.examples(
      "  texmesh view bust.texmesh\n"
      "  texmesh view packages/ --port 8080 --open");
  c.notes(
      "view prints the page's URL and serves until Ctrl-C. Only the viewer's files and packages can be "
      "reached.\n"
      "Exit code: 0, 1 when the package or the viewer is missing or the port is taken, 2 usage.");
  c.on_run([args] {
    view(*args);
    return kExitOk;
  });
}

}  // namespace texmesh
