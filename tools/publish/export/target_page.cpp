#include "tools/publish/export/target_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "format/documents/about.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "tools/publish/export/page_files.h"
#include "tools/publish/report/package_words.h"

namespace texmesh {
namespace {

std::string_view export_template(std::string_view name) {
  const auto files = export_page_files();
  return std::ranges::find(files, name, &BuiltInFile::name)->text;
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
                {{"beginning", page_beginning(title, "")},
                 {"style", std::string(export_template("export.css"))},
                 {"title", markup_escaped(title)},
                 {"alt", markup_escaped(about.description.empty() ? title : about.description)},
                 {"poster", poster ? " poster=\"poster.jpg\"" : ""},
                 {"script", markup_escaped(script)},
                 {"integrity", integrity},
                 {"rights", rights_line(about)},
                 {"bytes", markup_escaped(format_bytes(glb_bytes))}});
}

std::string oembed_page(const EmbeddedObject& object, const std::string& url, const std::string& viewer) {
  EmbeddedObject here = object;
  here.page_url = viewer;
  constexpr std::string_view kPolicy =
      "default-src 'none'; frame-src 'self'; img-src 'self' data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";
  return filled(export_template("oembed.html"), {{"beginning", page_beginning(object.about.title, kPolicy)},
                                                 {"style", std::string(export_template("export.css"))},
                                                 {"title", markup_escaped(object.about.title)},
                                                 {"oembed", markup_escaped(url + "oembed.json")},
                                                 {"frame", embedded_frame(here)},
                                                 {"code", markup_escaped(embedded_frame(object))},
                                                 {"rights", rights_line(object.about)}});
}

}  // namespace texmesh
