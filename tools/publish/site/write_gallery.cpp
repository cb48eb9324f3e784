#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/publish/report/package_words.h"
#include "tools/publish/site/gallery.h"
#include "tools/publish/site/page_files.h"
#include "tools/publish/view/site.h"

namespace texmesh {
namespace {

constexpr std::string_view kGalleryFirstLine = "<!DOCTYPE html><!-- texmesh site 1 -->\n";
/// Posters that are fetched with the page; those further down come when somebody looks.
constexpr std::size_t kAtOnce = 12;

std::string_view gallery_file(std::string_view name) {
  const auto files = site_page_files();
  return std::ranges::find(files, name, &BuiltInFile::name)->text;
}

std::string figures_of(const GalleryObject& o) {
  std::string out = format_bytes(o.bytes) + ", " + grouped(o.triangles) + " triangles";
  if (o.texture_px > 0) out += fmt::format(", textures of {} px", o.texture_px);
  return out;
}

/// What the search looks into: all texts, one line.
std::string words_of(const GalleryObject& o) {
  std::string out = o.title + " " + o.path;
  for (const NamedText& line : about_lines(o.about)) out += " " + line.text;
  return out;
}

std::string poster_html(const GalleryObject& o, const char* root, bool lazy) {
  if (o.poster.empty()) return "<span class=\"none\">no picture</span>";
  return fmt::format(R"(<img src="{}posters/{}.jpg" width="{}" height="{}" alt=""{}>)", root, o.name,
                     o.poster_width_px, o.poster_height_px, lazy ? " loading=\"lazy\"" : "");
}

std::string card_html(const GalleryObject& o, std::size_t place) {
  std::string quiet = markup_escaped(o.about.attribution.empty() ? o.about.creator : o.about.attribution);
  if (!o.about.licence.empty()) quiet += (quiet.empty() ? "" : ", ") + markup_escaped(o.about.licence);
  return fmt::format(
      "<li data-words=\"{}\"><a href=\"objects/{}.html\"><span class=\"poster\">{}</span><strong>{}</strong></a>"
      "<p>{}</p><p>{}</p></li>\n",
      markup_escaped(words_of(o)), o.name, poster_html(o, "", place >= kAtOnce), markup_escaped(o.title),
      quiet, markup_escaped(figures_of(o)));
}

/// The head of a page that stands `root` away from the gallery's files; `frames`: the page has frames.
std::string head_html(const std::string& title, const std::string& root, bool frames) {
  const std::string policy = fmt::format(
      "default-src 'none'; script-src 'self' file:; style-src 'self' file:; img-src 'self' file:; {}base-uri 'none'; form-action 'none'",
      frames ? "frame-src 'self' file:; " : "");
  return page_beginning(title, policy) +
         fmt::format(
             "<link rel=\"icon\" href=\"{0}icon.svg\" type=\"image/svg+xml\">\n"
             "<link rel=\"stylesheet\" href=\"{0}gallery.css\">\n"
             "<script defer=\"\" src=\"{0}gallery.js\"></script>\n",
             root);
}

std::string index_page(const Gallery& gallery) {
  std::string cards;
  for (std::size_t k = 0; k < gallery.objects.size(); ++k) cards += card_html(gallery.objects[k], k);
  const std::size_t n = gallery.objects.size();
  return filled(gallery_file("index.html"),
                {{"head", head_html(gallery.options.title, "", false)},
                 {"title", markup_escaped(gallery.options.title)},
                 {"count", fmt::format("{} {}", n, n == 1 ? "object" : "objects")},
                 {"cards", cards}});
}

std::string text_html(const NamedText& line) {
  const std::string text = markup_escaped(line.text);
  return is_web_url(line.text) ? "<a href=\"" + text + "\">" + text + "</a>" : text;
}

/// Rows of what is known of the object.
std::string facts_html(const GalleryObject& o) {
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

std::string object_page(const GalleryObject& o, const GalleryOptions& options) {
  const std::string viewer = "../viewer/index.html?panel=0&pkg=" + percent_encoded(from_below(o.address));
  return filled(
      gallery_file("object.html"),
      {{"head", head_html(o.title + " - " + options.title, "../", true)},
       {"title", markup_escaped(o.title)},
       {"gallery", markup_escaped(options.title)},
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
std::string viewer_list(const Gallery& gallery) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const GalleryObject& o : gallery.objects) {
    nlohmann::ordered_json entry{{"url", from_below(o.address)}, {"title", o.title}};
    if (!o.poster.empty()) entry["poster"] = "../posters/" + o.name + ".jpg";
    list.push_back(std::move(entry));
  }
  return nlohmann::ordered_json{{"packages", list}}.dump(-1, ' ', false,
                                                         nlohmann::ordered_json::error_handler_t::replace);
}

FolderRule gallery_folder_rule() {
  return marked_folder_rule("index.html", kGalleryFirstLine,
                            "an empty folder, an earlier site, or nothing yet");
}

}  // namespace

void write_gallery(const Gallery& gallery, const std::string& folder) {
  NewFolder out(folder, gallery_folder_rule());
  out.add("index.html", text_bytes(std::string(kGalleryFirstLine) + index_page(gallery)));
  for (const char* name : {"gallery.css", "gallery.js", "icon.svg"})
    out.add(name, text_bytes(gallery_file(name)));
  for (const GalleryObject& o : gallery.objects) {
    out.add("objects/" + o.name + ".html", text_bytes(object_page(o, gallery.options)));
    if (!o.poster.empty()) out.add("posters/" + o.name + ".jpg", o.poster);
    if (gallery.options.packages_url.empty())
      out.copy(o.address.ends_with("/") ? o.address.substr(0, o.address.size() - 1) : o.address, o.source);
  }
  out.copy("viewer", gallery.options.viewer);
  out.add("viewer/packages.json", text_bytes(viewer_list(gallery)));
  out.publish();
}

void check_gallery_folder(const std::string& folder) { NewFolder(folder, gallery_folder_rule()); }

}  // namespace texmesh
