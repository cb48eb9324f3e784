// Whether a page is well formed and stands alone.
#pragma once
#include <set>
#include <string>
#include <vector>

namespace texmesh::testing {

/// What is wrong with the nesting of a page's tags, "" = nothing. Attributes stand between double quotes.
inline std::string tag_fault(const std::string& html) {
  const std::set<std::string> empty{"meta", "img", "link", "br", "input"};
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at)) {
    if (html.compare(at, 4, "<!--") == 0 || html.compare(at, 2, "<!") == 0) {
      at = html.find('>', at);
      continue;
    }
    std::size_t end = at + 1;
    for (bool quoted = false; end < html.size() && (quoted || html[end] != '>'); ++end)
      if (html[end] == '"') quoted = !quoted;
    if (end >= html.size()) return "a tag without an end: " + html.substr(at, 60);
    const std::string tag = html.substr(at + 1, end - at - 1);
    const bool closes = tag[0] == '/';
    const std::string name = tag.substr(closes, tag.find_first_of(" />", closes) - closes);
    const bool closed_itself = tag.back() == '/';
    if (closes) {
      if (open.empty() || open.back() != name)
        return "</" + name + "> closes " + (open.empty() ? "nothing" : open.back());
      open.pop_back();
    } else if (!closed_itself && !empty.contains(name)) {
      open.push_back(name);
      if (name == "style") {
        end = html.find("</style>", end);
        if (end == std::string::npos) return "a style without an end";
        at = end;
        continue;
      }
    }
    at = end;
  }
  return open.empty() ? "" : "<" + open.back() + "> stays open";
}

/// The values of an attribute, in the order of the page.
inline std::vector<std::string> attributes(const std::string& html, const std::string& name) {
  std::vector<std::string> all;
  const std::string start = " " + name + "=\"";
  for (std::size_t at = html.find(start); at != std::string::npos; at = html.find(start, at)) {
    at += start.size();
    all.push_back(html.substr(at, html.find('"', at) - at));
  }
  return all;
}

}  // namespace texmesh::testing
