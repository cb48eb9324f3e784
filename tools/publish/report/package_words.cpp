#include "tools/publish/report/package_words.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/io/markup.h"

namespace texmesh {

std::string last_name(const std::string& path) {
  const std::filesystem::path p(path);
  return (p.has_filename() ? p : p.parent_path()).filename().string();
}

std::string package_title(PackageReader& package) {
  const std::string& title = package.manifest().title;
  return title.empty() ? last_name(package.store().name()) : title;
}

std::string rights_line(const About& about) {
  std::string out = markup_escaped(about.attribution.empty() ? about.creator : about.attribution);
  if (!about.licence.empty()) {
    const std::string licence = markup_escaped(about.licence);
    if (!out.empty()) out += ", ";
    out += about.licence_url.empty() ? licence
                                     : fmt::format("<a rel=\"license\" href=\"{}\">{}</a>",
                                                   markup_escaped(about.licence_url), licence);
  }
  return out.empty() ? out : "<p class=\"quiet\">" + out + "</p>\n";
}

}  // namespace texmesh
