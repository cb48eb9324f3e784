#include "tools/publish/site/site.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/text_bytes.h"
#include "format/rules/output_transform.h"
#include "pipeline/batch/stale_packages.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "tools/extract/usdz/usdz.h"
#include "tools/publish/export/export.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/site/site_words.h"
#include "tools/publish/view/view_server.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

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
  check_completeness(package);
  const Manifest& m = package.manifest();
  object.digest = to_hex(package.id()).substr(0, 16);
  object.about = package.about();
  object.annotations = package.annotations();
  object.title = m.title.empty() ? readable_title(object.path) : m.title;
  object.names_itself = !m.title.empty();
  if (object.about.metres_per_unit > 0)
    object.size = sides_in_words((m.bounds_max - m.bounds_min) * object.about.metres_per_unit);
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
std::string way_to_root(const SiteObject& o) {
  std::string root = "../";
  for (const char c : o.name)
    if (c == '/') root += "../";
  return root;
}

constexpr const char* kGlbMediaType = "model/gltf-binary";
constexpr const char* kUsdzMediaType = "model/vnd.usdz+zip";
constexpr std::string_view kSiteFirstLine = "<!DOCTYPE html><!-- texmesh site 1 -->\n";
/// Posters that are fetched with the page; those further down come when somebody looks.
constexpr std::size_t kAtOnce = 12;

std::string_view site_file(std::string_view name) { return built_in_text(site_page_files(), name); }

std::string figures_of(const SiteObject& o, const SiteWords& words) {
  std::string out = format_bytes(o.bytes) + ", " + grouped(o.triangles) + " " + words("triangles");
  if (o.texture_px > 0) out += ", " + words("textures", {{"px", std::to_string(o.texture_px)}});
  return out;
}

/// What the search looks into: all texts, one line.
std::string words_of(const SiteObject& o) {
  std::string out = o.title + " " + o.path;
  for (const NamedText& line : about_lines(o.about)) out += " " + line.text;
  for (const Annotation& note : o.annotations.list)
    for (const AnnotationText& text : note.texts) out += " " + text.title;
  return out;
}

std::string poster_html(const SiteObject& o, const std::string& root, bool lazy, const SiteWords& words) {
  if (o.poster.empty()) return "<span class=\"none\">" + words.html("no picture") + "</span>";
  return fmt::format(R"(<img src="{}{}" width="{}" height="{}" alt=""{}>)", root, o.poster_address,
                     o.poster_width_px, o.poster_height_px, lazy ? " loading=\"lazy\"" : "");
}

std::string card_html(const SiteObject& o, std::size_t place, const SiteWords& words) {
  std::string quiet = markup_escaped(o.about.attribution.empty() ? o.about.creator : o.about.attribution);
  if (!o.about.licence.empty()) quiet += (quiet.empty() ? "" : ", ") + markup_escaped(o.about.licence);
  return fmt::format(
      "<li data-words=\"{}\" data-facets=\"{}\"><a href=\"objects/{}.html\"><span class=\"poster\">{}</span><strong>{}</strong></a>"
      "{}{}</li>\n",
      markup_escaped(words_of(o)), markup_escaped(facets_of(o)), percent_encoded(o.name),
      poster_html(o, "", place >= kAtOnce, words), markup_escaped(o.title),
      quiet.empty() ? "" : "<p>" + quiet + "</p>",
      o.size.empty() ? "" : "<p>" + markup_escaped(o.size) + "</p>");
}

using OrderedJson = nlohmann::ordered_json;

std::string json_text(const OrderedJson& json, int indent) {
  return json.dump(indent, ' ', false, OrderedJson::error_handler_t::replace);
}

/// The first four digits that stand alone, or begin a date in eight; "" without.
std::string year_in(const std::string& text) {
  constexpr const char* kDigits = "0123456789";
  for (std::size_t at = 0; (at = text.find_first_of(kDigits, at)) != text.npos;) {
    const std::size_t end = std::min(text.find_first_not_of(kDigits, at), text.size());
    if (end - at == 4 || end - at == 8) return text.substr(at, 4);
    at = end;
  }
  return "";
}

/// When the model was made, which is not when the object was: that one was found or carved long before. Dates
/// that say neither count where no other says more.
std::string year_of(const About& about) {
  static const std::set<std::string> of_models{"scanned",      "captured", "digitised", "digitized",
                                               "photographed", "modelled", "modeled",   "xmp:createdate"},
      of_either{"created", "date", "dc:date", "published"};
  for (const auto* events : {&of_models, &of_either})
    for (const NamedText& date : about.dates)
      if (events->contains(in_lower_case(date.name)))
        if (const std::string year = year_in(date.text); !year.empty()) return year;
  return "";
}

/// How the object wants to be credited, and its licence.
std::string citation_note(const About& about) {
  const std::string licence = about.licence.empty() ? "" : "Licence: " + about.licence;
  return about.attribution + (about.attribution.empty() || licence.empty() ? "" : "; ") + licence;
}

std::string in_tex(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\textbackslash{}";
    else if (c == '~' || c == '^')
      out += std::string("\\") + c + "{}";
    else if (std::string_view("{}%&#_$").find(c) != std::string_view::npos)
      out += std::string("\\") + c;
    else
      out += c == '\n' ? ' ' : c;
  }
  return out;
}

/// Letters and digits of the package's path.
std::string citation_key(const SiteObject& o) {
  std::string key;
  for (const char c : o.name)
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) key += c;
  return key.empty() ? o.digest : key;
}

std::string address_within(const std::string& address, const SiteOptions& options) {
  return is_web_url(address) ? address : options.url + address;
}

/// Address of an object's page.
std::string page_address(const SiteObject& object, const SiteOptions& options) {
  return options.url + "objects/" + percent_encoded(object.name) + ".html";
}

std::string viewer_address(const SiteObject& o, const SiteOptions& options) {
  const std::string package = is_web_url(o.address) ? o.address : "../" + o.address;
  return options.url + "viewer/index.html?panel=none&pkg=" + percent_encoded(package);
}

std::string meta_html(const char* kind, const char* name, const std::string& content) {
  if (content.empty()) return "";
  return fmt::format("<meta {}=\"{}\" content=\"{}\">\n", kind, name, markup_escaped(content));
}

/// What schema.org calls it.
OrderedJson schema_org(const SiteObject& o, const SiteOptions& options) {
  const About& a = o.about;
  OrderedJson json{{"@context", "https://schema.org"}, {"@type", "3DModel"}, {"name", o.title}};
  const auto add = [&](const char* key, const OrderedJson& value, bool known) {
    if (known) json[key] = value;
  };
  add("description", a.description, !a.description.empty());
  add("creator", {{"@type", "Person"}, {"name", a.creator}}, !a.creator.empty());
  if (const std::string page = creator_url(a); !page.empty()) json["creator"]["url"] = page;
  add("creditText", a.attribution, !a.attribution.empty());
  add("license", a.licence_url.empty() ? a.licence : a.licence_url,
      !a.licence.empty() || !a.licence_url.empty());
  add("isBasedOn", a.source_url, !a.source_url.empty());
  for (const NamedText& i : a.identifiers)
    if (i.name != kCreatorScheme)
      json["identifier"].push_back({{"@type", "PropertyValue"}, {"propertyID", i.name}, {"value", i.text}});
  if (options.url.empty()) return json;
  json["url"] = page_address(o, options);
  if (!o.poster.empty()) json["image"] = options.url + o.poster_address;
  json["encoding"] = OrderedJson::array();
  const auto encoding = [&](const std::string& address, const char* type) {
    json["encoding"].push_back({{"@type", "MediaObject"},
                                {"contentUrl", address_within(address, options)},
                                {"encodingFormat", type}});
  };
  encoding(o.address, kContainerMediaType);
  for (const SiteDownload& d : o.downloads) encoding(d.address, d.media_type);
  return json;
}

std::string opened_html(const std::string& heading, const std::string& text) {
  return fmt::format("<details><summary>{}</summary><pre>{}</pre></details>\n", markup_escaped(heading),
                     markup_escaped(text));
}

/// BibTeX's @misc: characters that TeX takes for its own stand for themselves.
std::string bibtex_entry(const SiteObject& o, const SiteOptions& options) {
  std::string out = "@misc{" + citation_key(o);
  const auto add = [&](const char* key, const std::string& value) {
    if (!value.empty()) out += fmt::format(",\n  {} = {{{}}}", key, value);
  };
  add("title", "{" + in_tex(o.title) + "}");
  if (!o.about.creator.empty()) add("author", "{" + in_tex(o.about.creator) + "}");
  add("year", year_of(o.about));
  add("howpublished", "3D model, " + in_tex(options.title));
  if (!options.url.empty()) add("url", page_address(o, options));
  add("note", in_tex(citation_note(o.about)));
  return out + "\n}\n";
}

/// One item of the Citation Style Language as JSON.
std::string csl_item(const SiteObject& o, const SiteOptions& options) {
  OrderedJson item{{"id", citation_key(o)}, {"type", "graphic"}, {"genre", "3D model"}, {"title", o.title}};
  if (!o.about.creator.empty()) item["author"] = {{{"literal", o.about.creator}}};
  if (const std::string year = year_of(o.about); !year.empty())
    item["issued"] = {{"date-parts", {{std::stoi(year)}}}};
  item["publisher"] = options.title;
  if (!options.url.empty()) item["URL"] = page_address(o, options);
  if (const std::string note = citation_note(o.about); !note.empty()) item["note"] = note;
  return json_text(item, 2) + "\n";
}

/// For the head: description, OpenGraph, and schema.org's 3DModel as JSON-LD.
std::string record_head(const SiteObject& o, const SiteOptions& options, const SiteWords& words) {
  std::string json = json_text(schema_org(o, options), -1);
  // Nothing in a text may end the element, or begin a comment.
  for (std::size_t at = 0; (at = json.find('<', at)) != json.npos;) json.replace(at, 1, "\\u003c");
  std::string text = o.about.description.substr(0, o.about.description.find('\n'));
  if (text.empty())
    text =
        words(o.about.creator.empty() ? "one" : "one by", {{"title", o.title}, {"creator", o.about.creator}});
  std::string out = meta_html("name", "description", text) + meta_html("property", "og:type", "website") +
                    meta_html("property", "og:title", o.title) +
                    meta_html("property", "og:description", text) +
                    meta_html("property", "og:site_name", options.title);
  if (!options.url.empty()) {
    out += fmt::format("<link rel=\"canonical\" href=\"{}\">\n", markup_escaped(page_address(o, options)));
    out += meta_html("property", "og:url", page_address(o, options));
    if (!o.poster.empty()) out += meta_html("property", "og:image", options.url + o.poster_address);
  }
  return out + "<script type=\"application/ld+json\">" + json + "</script>\n";
}

/// Citations and, with the site's address, the frame for pages of others; each behind a heading that opens
/// it.
std::string citation_html(const SiteObject& o, const SiteOptions& options, const SiteWords& words) {
  std::string out = opened_html(words("cite", {{"form", "BibTeX"}}), bibtex_entry(o, options)) +
                    opened_html(words("cite", {{"form", "CSL-JSON"}}), csl_item(o, options));
  if (options.url.empty()) return out;
  EmbeddedObject frame;
  frame.about = o.about;
  frame.about.title = o.title;
  frame.page_url = viewer_address(o, options);
  return out + opened_html(words("embed"), embedded_frame(frame) + "\n");
}

/// sitemap.xml of a site that knows its address.
std::string sitemap_text(const Site& site) {
  std::string out =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<urlset xmlns=\"http://www.sitemaps.org/schemas/sitemap/0.9\">\n";
  const auto add = [&](const std::string& address) {
    out += "<url><loc>" + markup_escaped(address) + "</loc></url>\n";
  };
  add(site.options.url);
  for (const SiteObject& o : site.objects) add(page_address(o, site.options));
  return out + "</urlset>\n";
}

/// The head of a page that stands `root` away from the site's files; `frames`: the page has frames.
std::string head_html(const std::string& title, const std::string& root, bool frames,
                      const SiteWords& words) {
  const std::string policy = fmt::format(
      "default-src 'none'; script-src 'self' file:; style-src 'self' file:; img-src 'self' file:; {}base-uri 'none'; form-action 'none'",
      frames ? "frame-src 'self' file:; " : "");
  return page_beginning(title, policy, words("language")) +
         fmt::format(
             "<link rel=\"icon\" href=\"{0}icon.svg\" type=\"image/svg+xml\">\n"
             "<link rel=\"stylesheet\" href=\"{0}site.css\">\n"
             "<script defer=\"\" src=\"{0}site.js\"></script>\n",
             root);
}

/// What search engines and social networks show of the list.
std::string index_record(const Site& site, const SiteWords& words) {
  constexpr std::size_t kNamed = 5;
  std::string text = words("list", {{"title", site.options.title}});
  for (std::size_t k = 0; k < std::min(kNamed, site.objects.size()); ++k)
    text += (k == 0 ? ": " : ", ") + site.objects[k].title;
  const std::string& url = site.options.url;
  const auto shown =
      std::ranges::find_if(site.objects, [](const SiteObject& o) { return !o.poster.empty(); });
  return meta_html("name", "description", text) + meta_html("property", "og:type", "website") +
         meta_html("property", "og:title", site.options.title) + meta_html("property", "og:url", url) +
         (url.empty() || shown == site.objects.end()
              ? ""
              : meta_html("property", "og:image", url + shown->poster_address));
}

std::string index_page(const Site& site, const SiteWords& words) {
  std::string cards;
  for (std::size_t k = 0; k < site.objects.size(); ++k) cards += card_html(site.objects[k], k, words);
  return filled(site_file("index.html"),
                {{"head", head_html(site.options.title, "", false, words) + index_record(site, words)},
                 {"title", markup_escaped(site.options.title)},
                 {"skip", words.html("skip")},
                 {"search", words.html("search")},
                 {"facets", facets_html(site.objects, words)},
                 {"of", words.html("of")},
                 {"count", markup_escaped(words.objects(site.objects.size()))},
                 {"cards", cards}});
}

std::string text_html(const NamedText& line) {
  const std::string text = markup_escaped(line.text);
  return is_web_url(line.text) ? "<a href=\"" + text + "\">" + text + "</a>" : text;
}

/// Rows of what is known of the object.
std::string facts_html(const SiteObject& o, const SiteWords& words) {
  std::string out;
  const auto row = [&](const std::string& name, const std::string& html) {
    out += "<dt>" + words.html(name) + "</dt><dd>" + html + "</dd>\n";
  };
  // The page's own places, and what is said to programs.
  static const std::set<std::string_view> for_others{"title", "description", "unit", "up axis"};
  for (const NamedText& line : about_lines(o.about))
    if (!for_others.contains(line.name)) row(line.name, text_html(line));
  if (!o.size.empty()) row("size", markup_escaped(o.size));
  row("package", markup_escaped(figures_of(o, words)));
  return out;
}

std::string from_below(const std::string& root, const std::string& address) {
  return is_web_url(address) ? address : root + address;
}

/// Links behind that of the package. Apple's phones open a USDZ in the room from a link that holds a picture
/// and nothing else.
std::string downloads_html(const SiteObject& o, const std::string& root, const SiteWords& words) {
  std::string out;
  for (const SiteDownload& d : o.downloads)
    out += fmt::format(R"( <a href="{}{}" type="{}" download="">{}, {}</a>)", root, d.address, d.media_type,
                       d.name, markup_escaped(format_bytes(d.bytes)));
  for (const SiteDownload& d : o.downloads)
    if (d.media_type == kUsdzMediaType)
      out += fmt::format(
          R"(</p>
<p><a rel="ar" href="{0}{1}"><img src="{0}{2}" width="64" height="64" alt="{3}"></a> {4})",
          root, d.address, o.poster.empty() ? "icon.svg" : o.poster_address, words.html("room"),
          words.html("room on"));
  return out;
}

std::string object_page(const SiteObject& o, const SiteOptions& options, const SiteWords& words) {
  const std::string root = way_to_root(o);
  // The package's address is encoded twice: the viewer decodes the query before it takes the value for a URL.
  const std::string viewer =
      root + "viewer/index.html?panel=none&pkg=" + percent_encoded(from_below("../", o.address)) +
      (o.poster.empty() ? "" : "&poster=" + percent_encoded("../" + o.poster_address)) +
      (o.names_itself ? "" : "&title=" + percent_encoded(o.title));
  return filled(
      site_file("object.html"),
      {{"head",
        head_html(o.title + " - " + options.title, root, true, words) + record_head(o, options, words)},
       {"title", markup_escaped(o.title)},
       {"root", root},
       {"site", markup_escaped(options.title)},
       {"viewer", markup_escaped(viewer)},
       {"poster", poster_html(o, root, false, words)},
       {"site label", words.html("site")},
       {"show", words.html("show")},
       {"cost",
        words.html("cost", {{"bytes", format_bytes(o.bytes)}, {"start", format_bytes(o.start_bytes)}})},
       {"window", words.html("whole window")},
       {"package word", words.html("package")},
       {"notes", o.annotations.list.empty()
                     ? ""
                     : "<h2>" + words.html("notes") + "</h2>\n" + notes_html(o.annotations)},
       {"description", o.about.description.empty()
                           ? ""
                           : "<p class=\"description\">" + markup_escaped(o.about.description) + "</p>"},
       {"rights", rights_line(o.about)},
       {"facts", facts_html(o, words)},
       {"downloads", downloads_html(o, root, words)},
       {"citation", citation_html(o, options, words)},
       {"package", markup_escaped(from_below(root, o.address))}});
}

/// Writes the files of an object for other programs.
void add_downloads(SiteObject& o, const SiteOptions& options, NewFolder& out, const RunContext& context) {
  PackageReader package(open_store(o.source));
  ExtractScale scale;
  scale.display_px = options.downloads_px;
  const Extracted glb = extract_model(package, {scale, true}, context);
  const auto add = [&](const char* name, const char* media_type, const char* ending, const Bytes& bytes) {
    const std::string path = file_address("downloads", o, ending);
    out.add(path, bytes);
    o.downloads.push_back({name, media_type, percent_encoded(path), bytes.size()});
  };
  add("GLB", kGlbMediaType, ".glb", glb.glb);
  try {
    const About about = transformed_about(o.about, output_transform(o.about, {}, false));
    add("USDZ", kUsdzMediaType, ".usdz", usdz_of(glb, about, o.path, context).file);
  } catch (const InputError&) {  // what no USDZ can say; the GLB has it
  }
}

/// What the viewer offers where its address names no package.
std::string viewer_list(const Site& site) {
  PackageList list;
  for (const SiteObject& o : site.objects)
    list.packages.push_back(
        {from_below("../", o.address), o.title, o.poster.empty() ? "" : "../" + o.poster_address});
  return to_json_line(list);
}

}  // namespace

std::string object_name(const std::string& path) {
  const std::string key = name_key(without_ending(path));
  std::string name;
  for (const std::string_view part : pieces_of(key, '/')) name += "/" + file_name_of(std::string(part));
  return name.substr(1);
}

Site read_site(const std::string& packages, const SiteOptions& options) {
  Site site{options, {}, {}, {}, {}};
  const PackageFolder folder = find_packages(packages);
  site.links = links_left_out(folder);
  const std::set<std::string> stale = listed_stale(folder.path);
  std::map<std::string, std::string> taken;  // path of the package, by the name of its pages
  for (const std::string& path : folder.packages) {
    SiteObject object;
    object.path = path;
    object.name = object_name(path);
    if (stale.contains(path)) {
      site.stale.push_back(path);
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
    object.poster_address = percent_encoded(file_address("posters", object, ".jpg"));
    site.objects.push_back(std::move(object));
  }
  std::ranges::sort(site.objects, {},
                    [](const SiteObject& o) { return std::tuple(in_lower_case(o.title), o.path); });
  return site;
}

std::string unknown_units(const Site& site) {
  const auto unknown = [](const SiteObject& o) { return o.about.metres_per_unit == 0; };
  const auto first = std::ranges::find_if(site.objects, unknown);
  if (site.options.downloads_px == 0 || first == site.objects.end()) return "";
  const auto count = static_cast<std::uint64_t>(std::ranges::count_if(site.objects, unknown));
  return fmt::format(
      "the unit of length of {} is not known{}; programs and iPhones take lengths in the downloads for metres "
      "(texmesh compile --meta tells the unit)",
      count == 1 ? first->path : counted(count, "package"), count == 1 ? "" : ", as of " + first->path);
}

FolderRule site_folder_rule() {
  return marked_folder_rule("index.html", kSiteFirstLine, "an empty folder, an earlier site, or nothing yet");
}

void write_site(const Site& site, const std::string& folder, const RunContext& context) {
  const SiteWords words =
      site.options.words.empty() ? SiteWords() : SiteWords(site.options.words, site.options.words_file);
  NewFolder out(folder, site_folder_rule());
  out.add("index.html", text_bytes(std::string(kSiteFirstLine) + index_page(site, words)));
  out.add("site.css", text_bytes(page_style(site_file("site.css")) + site.options.style));
  for (const char* name : {"site.js", "icon.svg"}) out.add(name, text_bytes(site_file(name)));
  if (!site.options.url.empty()) out.add("sitemap.xml", text_bytes(sitemap_text(site)));
  for (SiteObject o : site.objects) {
    if (site.options.downloads_px > 0) add_downloads(o, site.options, out, context);
    out.add("objects/" + o.name + ".html", text_bytes(object_page(o, site.options, words)));
    if (!o.poster.empty()) out.add(file_address("posters", o, ".jpg"), o.poster);
    if (site.options.packages_url.empty())
      out.copy(file_address("packages", o, o.path.ends_with("/") ? "" : ".texmesh"), o.source);
  }
  out.copy("viewer", site.options.viewer);
  out.add("viewer/packages.json", text_bytes(viewer_list(site)));
  out.publish();
}

}  // namespace texmesh
