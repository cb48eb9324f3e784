#include "pipeline/export/target_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "format/documents/about.h"
#include "pipeline/batch/progress.h"
#include "pipeline/export/page_files.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/uri.h"
#include "pipeline/report/package_words.h"

namespace texmesh {
namespace {

std::string_view export_template(std::string_view name) {
  const auto files = export_page_files();
  return std::ranges::find(files, name, &BuiltInFile::name)->text;
}

/// How a page may name where it loads a script from.
std::string source_of_script(const std::string& url) {
  const std::string origin = url_origin(url);
  return origin.empty() ? "'self'" : origin;
}

}  // namespace

std::string page_title(PackageReader& package) {
  const std::string title = package_title(package);
  constexpr std::string_view kEnding = ".texmesh";
  return title.ends_with(kEnding) ? title.substr(0, title.size() - kEnding.size()) : title;
}

std::string model_viewer_page(PackageReader& package, const ExportOptions& options, std::uint64_t glb_bytes) {
  const About& about = package.about();
  const auto& poster = package.manifest().poster;
  const std::string title = page_title(package);
  const std::string script = options.script.empty() ? kModelViewerScript : options.script;
  const std::string integrity =
      options.script.empty()
          ? fmt::format(R"( integrity="{}" crossorigin="anonymous")", kModelViewerIntegrity)
          : "";
  return filled(export_template("model-viewer.html"),
                {{"title", markup_escaped(title)},
                 {"alt", markup_escaped(about.description.empty() ? title : about.description)},
                 {"poster", poster ? " poster=\"poster.jpg\"" : ""},
                 {"script", markup_escaped(script)},
                 {"integrity", integrity},
                 {"script-source", markup_escaped(source_of_script(script))},
                 {"rights", rights_line(about)},
                 {"bytes", markup_escaped(format_bytes(glb_bytes))}});
}

std::string oembed_page(const EmbeddedObject& object, const std::string& url, const std::string& viewer) {
  EmbeddedObject here = object;
  here.page_url = viewer;
  return filled(export_template("oembed.html"), {{"title", markup_escaped(object.about.title)},
                                                 {"oembed", markup_escaped(url + "oembed.json")},
                                                 {"frame", embedded_frame(here)},
                                                 {"code", markup_escaped(embedded_frame(object))},
                                                 {"rights", rights_line(object.about)}});
}

}  // namespace texmesh
