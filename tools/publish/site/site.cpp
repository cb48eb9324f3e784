#include "tools/publish/site/site.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/text_bytes.h"
#include "pipeline/batch/stale_packages.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/view/served_files.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

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
  object.digest = to_hex(package.id()).substr(0, 16);
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

/// A part of a path as a file name of every system: not hidden, not too long, and without letters that some
/// file systems refuse. Different parts have different names, which no other part changes.
std::string file_name_of(const std::string& part) {
  constexpr std::size_t kMostBytes = 180;
  std::string name;
  if (part.empty()) return "=";
  for (const char c : part) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = byte >= 0x80 || (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || c == '-' ||
                       c == '_' || c == ' ' || (c == '.' && !name.empty());
    name += plain ? std::string(1, c) : fmt::format("={:02X}", byte);
  }
  if (name.ends_with(' ') || name.ends_with('.')) name += "=";  // Windows leaves them out
  if (name.size() <= kMostBytes) return name;
  const std::string digest = to_hex(sha256(text_bytes(part))).substr(0, 16);
  std::size_t kept = kMostBytes - digest.size() - 1;
  while (kept > 0 && (static_cast<unsigned char>(name[kept]) & 0xc0) == 0x80) --kept;  // whole letters
  return name.substr(0, kept) + "=" + digest;
}

/// The file of a package, or of its picture, by what it holds: a server may let browsers keep it for ever.
std::string file_address(const char* folder, const SiteObject& o, std::string_view ending) {
  return fmt::format("{}/{}.{}{}", folder, o.name, o.digest, ending);
}

std::string address_of(const SiteObject& object, const SiteOptions& options) {
  if (!options.packages_url.empty()) return options.packages_url + percent_encoded(object.path);
  return percent_encoded(file_address("packages", object, object.path.ends_with("/") ? "/" : ".texmesh"));
}

/// The way from an object's page to the site's files.
std::string root_of(const SiteObject& o) {
  std::string root = "../";
  for (const char c : o.name)
    if (c == '/') root += "../";
  return root;
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

std::string poster_address(const SiteObject& o) {
  return percent_encoded(file_address("posters", o, ".jpg"));
}

std::string poster_html(const SiteObject& o, const std::string& root, bool lazy) {
  if (o.poster.empty()) return "<span class=\"none\">no picture</span>";
  return fmt::format(R"(<img src="{}{}" width="{}" height="{}" alt=""{}>)", root, poster_address(o),
                     o.poster_width_px, o.poster_height_px, lazy ? " loading=\"lazy\"" : "");
}

std::string card_html(const SiteObject& o, std::size_t place) {
  std::string quiet = markup_escaped(o.about.attribution.empty() ? o.about.creator : o.about.attribution);
  if (!o.about.licence.empty()) quiet += (quiet.empty() ? "" : ", ") + markup_escaped(o.about.licence);
  return fmt::format(
      "<li data-words=\"{}\"><a href=\"objects/{}.html\"><span class=\"poster\">{}</span><strong>{}</strong></a>"
      "<p>{}</p><p>{}</p></li>\n",
      markup_escaped(words_of(o)), percent_encoded(o.name), poster_html(o, "", place >= kAtOnce),
      markup_escaped(o.title), quiet, markup_escaped(figures_of(o)));
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

std::string from_below(const std::string& root, const std::string& address) {
  return is_web_url(address) ? address : root + address;
}

std::string object_page(const SiteObject& o, const SiteOptions& options) {
  const std::string root = root_of(o);
  // The package's address is encoded twice: the viewer decodes the query before it takes the value for a URL.
  const std::string viewer =
      root + "viewer/index.html?panel=0&pkg=" + percent_encoded(from_below("../", o.address));
  return filled(
      site_file("object.html"),
      {{"head", head_html(o.title + " - " + options.title, root, true)},
       {"title", markup_escaped(o.title)},
       {"root", root},
       {"site", markup_escaped(options.title)},
       {"viewer", markup_escaped(viewer)},
       {"poster", poster_html(o, root, false)},
       {"bytes", markup_escaped(format_bytes(o.bytes))},
       {"start", markup_escaped(format_bytes(o.start_bytes))},
       {"description", o.about.description.empty()
                           ? ""
                           : "<p class=\"description\">" + markup_escaped(o.about.description) + "</p>"},
       {"rights", rights_line(o.about)},
       {"facts", facts_html(o)},
       {"package", markup_escaped(from_below(root, o.address))}});
}

/// What the viewer offers where its address names no package.
std::string viewer_list(const Site& site) {
  PackageList list;
  for (const SiteObject& o : site.objects)
    list.packages.push_back(
        {from_below("../", o.address), o.title, o.poster.empty() ? "" : "../" + poster_address(o)});
  return to_json_line(list);
}

}  // namespace

std::string object_name(const std::string& path) {
  const std::string key = name_key(without_ending(path));
  std::string name;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('/', begin), key.size());
    name += (begin > 0 ? "/" : "") + file_name_of(key.substr(begin, end - begin));
    begin = end + 1;
  }
  return name;
}

Site read_site(const std::string& packages, const SiteOptions& options) {
  Site site{options, {}, {}};
  const PackageFolder folder = find_packages(packages);
  const std::set<std::string> stale = listed_stale(folder.path);
  std::map<std::string, std::string> taken;  // path of the package, by the name of its pages
  for (const std::string& path : folder.packages) {
    SiteObject object;
    object.path = path;
    object.name = object_name(path);
    if (stale.contains(path)) {
      site.faults.push_back(
          {path,
           path + ": left out: no model makes this package any more (compile --remove-stale removes it)"});
      continue;
    }
    if (const auto [other, fresh] = taken.emplace(object.name, path); !fresh) {
      site.faults.push_back(
          {path, path +
                     ": expected a name that no other package has, also where case does not count, found " +
                     other->second + " beside it"});
      continue;
    }
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
    if (!o.poster.empty()) out.add(file_address("posters", o, ".jpg"), o.poster);
    if (site.options.packages_url.empty())
      out.copy(file_address("packages", o, o.path.ends_with("/") ? "" : ".texmesh"), o.source);
  }
  out.copy("viewer", site.options.viewer);
  out.add("viewer/packages.json", text_bytes(viewer_list(site)));
  out.publish();
}

}  // namespace texmesh
