#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace texmesh {

/// A table with a caption; cells are HTML. The first column holds row headers, the others numbers.
struct HtmlTable {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  bool sentences = false;  // no numbers: to the left, and broken into lines
  std::string html() const;
};

/// A section of the page with a heading; `body` is HTML, `id` a name of letters.
std::string html_section(const std::string& id, const std::string& heading, const std::string& body);

/// A page that stands alone: no script, nothing from elsewhere but files beside it. Light and dark by the
/// reader's choice, and fit to print. `title` is plain text, `body` HTML. The first line is
/// kReportFirstLine.
std::string html_page(const std::string& title, const std::string& body);

/// By this line a report is known from other pages.
inline constexpr std::string_view kReportFirstLine = "<!DOCTYPE html><!-- texmesh report 1 -->\n";

}  // namespace texmesh
