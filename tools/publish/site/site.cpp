#include "tools/publish/site/site.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/text_bytes.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/view/served_files.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostNameBytes = 100;

std::string in_lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::uint64_t bytes_beneath(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uint64_t bytes = 0;
  for (const fs::directory_entry& e : fs::recursive_directory_iterator(path))
    if (fs::is_regular_file(e.symlink_status())) bytes += e.file_size();
  return bytes;
}

std::string without_ending(std::string path) {
  if (path.ends_with("/")) path.pop_back();
  return path.ends_with(".texmesh") ? path.substr(0, path.size() - 8) : path;
}

void read_object(SiteObject& object) {
  PackageReader package(open_store(object.source));
  const Manifest& m = package.manifest();
  object.about = package.about();
  object.title = m.title.empty() ? fs::path(without_ending(object.path)).filename().string() : m.title;
  object.bytes = bytes_beneath(object.source);
  object.start_bytes = start_bytes(m);
  object.triangles = m.scales.front().triangles;
  for (const TextureInfo& t : package.textures())
    object.texture_px = std::max({object.texture_px, t.width_px, t.height_px});
  if (!m.poster) return;
  object.poster = package.entry(*m.poster);
  object.poster_width_px = m.poster->width_px;
  object.poster_height_px = m.poster->height_px;
}

std::string address_of(const SiteObject& object, const SiteOptions& options) {
  if (!options.packages_url.empty()) return options.packages_url + percent_encoded(object.path);
  return "packages/" + object.name + (object.path.ends_with("/") ? "/" : ".texmesh");
}

constexpr std::string_view kSiteFirstLine = "<!DOCTYPE html><!-- texmesh site 1 -->\n";
/// Posters that are fetched with the page; those further down come when somebody looks.
constexpr std::size_t kAtOnce = 12;

std::string_view site_file(std::string_view name) { return built_in_text(site_page_files(), name); }

std::string figures_of(const SiteObject& o) {
  std::string out = format_bytes(o.bytes) + ", " + grouped(o.triangles) + " triangles";
  if (o.texture_px > 0) out += fmt::format(", textures of {} px", o.texture_px);
  return out;
}

/// What the search looks into: all texts, one line.
std::string words_of(const SiteObject& o) {
  std::string out = o.title + " " + o.path;
  for (const NamedText& line : about_lines(o.about)) out += " " + line.text;
  return out;
}

std::string poster_html(const SiteObject& o, const char* root, bool lazy) {
  if (o.poster.empty()) return "<span class=\"none\">no picture</span>";
  return fmt::format(R"(<img src="{}posters/{}.jpg" width="{}" height="{}" alt=""{}>)", root, o.name,
                     o.poster_width_px, o.poster_height_px, lazy ? " loading=\"lazy\"" : "");
}

std::string card_html(const SiteObject& o, std::size_t place) {
  std::string quiet = markup_escaped(o.about.attribution.empty() ? o.about.creator : o.about.attribution);
  if (!o.about.licence.empty()) quiet += (quiet.empty() ? "" : ", ") + markup_escaped(o.about.licence);
  return fmt::format(
      "<li data-words=\"{}\"><a href=\"objects/{}.html\"><span class=\"poster\">{}</span><strong>{}</strong></a>"
      "<p>{}</p><p>{}</p></li>\n",
      markup_escaped(words_of(o)), o.name, poster_html(o, "", place >= kAtOnce), markup_escaped(o.title),
      quiet, markup_escaped(figures_of(o)));
}

/// The head of a page that stands `root` away from the site's files; `frames`: the page has frames.
std::string head_html(const std::string& title, const std::string& root, bool frames) {
  const std::string policy = fmt::format(
      "default-src 'none'; script-src 'self' file:; style-src 'self' file:; img-src 'self' file:; {}base-uri 'none'; form-action 'none'",
      frames ? "frame-src 'self' file:; " : "");
  return page_beginning(title, policy) +
         fmt::format(
             "<link rel=\"icon\" href=\"{0}icon.svg\" type=\"image/svg+xml\">\n"
             "<link rel=\"stylesheet\" href=\"{0}site.css\">\n"
             "<script defer=\"\" src=\"{0}site.js\"></script>\n",
             root);
}

std::string index_page(const Site& site) {
  std::string cards;
  for (std::size_t k = 0; k < site.objects.size(); ++k) cards += card_html(site.objects[k], k);
  const std::size_t n = site.objects.size();
  return filled(site_file("index.html"), {{"head", head_html(site.options.title, "", false)},
                                          {"title", markup_escaped(site.options.title)},
                                          {"count", fmt::format("{} {}", n, n == 1 ? "object" : "objects")},
                                          {"cards", cards}});
}

std::string text_html(const NamedText& line) {
  const std::string text = markup_escaped(line.text);
  return is_web_url(line.text) ? "<a href=\"" + text + "\">" + text + "</a>" : text;
}

/// Rows of what is known of the object.
std::string facts_html(const SiteObject& o) {
  std::string out;
  const auto row = [&](const std::string& name, const std::string& html) {
    out += "<dt>" + markup_escaped(name) + "</dt><dd>" + html + "</dd>\n";
  };
  for (const NamedText& line : about_lines(o.about))
    if (line.name != "title" && line.name != "description") row(line.name, text_html(line));
  row("package", markup_escaped(figures_of(o)));
  row("first picture", "after " + markup_escaped(format_bytes(o.start_bytes)));
  return out;
}

/// Addresses of an object's page lead out of objects/, those of the viewer out of viewer/.
std::string from_below(const std::string& address) { return is_web_url(address) ? address : "../" + address; }

std::string object_page(const SiteObject& o, const SiteOptions& options) {
  const std::string viewer = "../viewer/index.html?panel=0&pkg=" + percent_encoded(from_below(o.address));
  return filled(
      site_file("object.html"),
      {{"head", head_html(o.title + " - " + options.title, "../", true)},
       {"title", markup_escaped(o.title)},
       {"site", markup_escaped(options.title)},
       {"viewer", markup_escaped(viewer)},
       {"poster", poster_html(o, "../", false)},
       {"bytes", markup_escaped(format_bytes(o.bytes))},
       {"start", markup_escaped(format_bytes(o.start_bytes))},
       {"description", o.about.description.empty()
                           ? ""
                           : "<p class=\"description\">" + markup_escaped(o.about.description) + "</p>"},
       {"rights", rights_line(o.about)},
       {"facts", facts_html(o)},
       {"package", markup_escaped(from_below(o.address))}});
}

/// What the viewer offers where its address names no package.
std::string viewer_list(const Site& site) {
  PackageList list;
  for (const SiteObject& o : site.objects)
    list.packages.push_back(
        {from_below(o.address), o.title, o.poster.empty() ? "" : "../posters/" + o.name + ".jpg"});
  return to_json_line(list);
}

}  // namespace

std::string object_name(const std::string& path, std::vector<std::string>& taken) {
  std::string name;
  for (const char c : without_ending(path)) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       c == '-' || c == '_' || c == '.';
    if (plain || name.empty() || name.back() != '-') name += plain ? c : '-';
  }
  name.resize(std::min(name.size(), kMostNameBytes));
  // A name that begins with a dot is hidden on servers.
  if (name.empty() || name.front() == '.' || std::ranges::find(taken, in_lower_case(name)) != taken.end()) {
    constexpr std::size_t kDigits = 10;
    name = "p" + name + "-" + to_hex(sha256(text_bytes(path))).substr(0, kDigits);
  }
  taken.push_back(in_lower_case(name));
  return name;
}

Site read_site(const std::string& packages, const SiteOptions& options) {
  Site site{options, {}, {}};
  const PackageFolder folder = find_packages(packages);
  std::vector<std::string> taken;
  for (const std::string& path : folder.packages) {
    SiteObject object;
    object.path = path;
    object.source = (fs::path(folder.path) / path).string();
    try {
      read_object(object);
    } catch (const InputError& error) {
      site.faults.push_back({path, error.what()});
      continue;
    } catch (const FormatError& error) {
      site.faults.push_back({path, error.what()});
      continue;
    }
    object.name = object_name(path, taken);
    object.address = address_of(object, options);
    site.objects.push_back(std::move(object));
  }
  std::ranges::sort(site.objects, {},
                    [](const SiteObject& o) { return std::tuple(in_lower_case(o.title), o.path); });
  return site;
}

DocumentSchema site_schema() {
  return document_schema("site.v1", "texmesh site report, version 1",
                         "Output of `texmesh site PACKAGES -o DIR --json`: what the site shows.",
                         schema_of<SiteReport>());
}

FolderRule site_folder_rule() {
  return marked_folder_rule("index.html", kSiteFirstLine, "an empty folder, an earlier site, or nothing yet");
}

void write_site(const Site& site, const std::string& folder) {
  NewFolder out(folder, site_folder_rule());
  out.add("index.html", text_bytes(std::string(kSiteFirstLine) + index_page(site)));
  out.add("site.css", text_bytes(page_style(site_file("site.css"))));
  for (const char* name : {"site.js", "icon.svg"}) out.add(name, text_bytes(site_file(name)));
  for (const SiteObject& o : site.objects) {
    out.add("objects/" + o.name + ".html", text_bytes(object_page(o, site.options)));
    if (!o.poster.empty()) out.add("posters/" + o.name + ".jpg", o.poster);
    if (site.options.packages_url.empty())
      out.copy(o.address.ends_with("/") ? o.address.substr(0, o.address.size() - 1) : o.address, o.source);
  }
  out.copy("viewer", site.options.viewer);
  out.add("viewer/packages.json", text_bytes(viewer_list(site)));
  out.publish();
}

}  // namespace texmesh
