#include "tools/publish/pages/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/io/markup.h"

namespace texmesh {

std::string_view built_in_text(std::span<const BuiltInFile> files, std::string_view name) {
  return std::ranges::find(files, name, &BuiltInFile::name)->text;
}

std::string page_style(std::string_view own) {
  return std::string(built_in_text(pages_page_files(), "base.css")) + std::string(own);
}

std::string filled(std::string_view text, const TemplateValues& values) {
  std::string out;
  for (;;) {
    const std::size_t begin = text.find("{{"), end = text.find("}}", begin);
    if (begin == std::string_view::npos || end == std::string_view::npos) break;
    const std::string_view name = text.substr(begin + 2, end - begin - 2);
    const auto value = values.find(name);
    if (value == values.end()) throw std::logic_error("a page asks for {{" + std::string(name) + "}}");
    out += text.substr(0, begin);
    out += value->second;
    text.remove_prefix(end + 2);
  }
  return out += text;
}

std::string html_page(const std::string& title, const std::string& body) {
  const std::span<const BuiltInFile> files = pages_page_files();
  return std::string(kReportFirstLine) +
         filled(
             built_in_text(files, "report.html"),
             {{"beginning",
               page_beginning(title, "default-src 'none'; img-src 'self' file:; style-src 'unsafe-inline'")},
              {"style", page_style(built_in_text(files, "report.css"))},
              {"body", body}});
}

std::string html_section(const std::string& id, const std::string& heading, const std::string& body) {
  return fmt::format("<section aria-labelledby=\"{0}\">\n<h2 id=\"{0}\">{1}</h2>\n{2}</section>\n", id,
                     heading, body);
}

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
