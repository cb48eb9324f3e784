#include "tools/publish/site/site_words.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/text_bytes.h"
#include "pipeline/io/markup.h"
#include "tools/publish/pages/page.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostWordBytes = 500, kMostFacetValues = 200;

std::string trimmed(std::string text) {
  const std::size_t begin = text.find_first_not_of(' ');
  if (begin == text.npos) return "";
  return text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

void add_text(std::set<std::string>& to, const std::string& text) {
  if (std::string clean = trimmed(clean_text(text, kMaxAboutNameBytes)); !clean.empty())
    to.insert(std::move(clean));
}

/// Each part of a text between separators.
std::set<std::string> listed_texts(const std::string& text, char separator) {
  std::set<std::string> parts;
  for (const std::string_view part : pieces_of(text, separator)) add_text(parts, std::string(part));
  return parts;
}

/// A text, or a list of texts, that the publisher has added.
std::set<std::string> from_extras(const About& about, const char* name) {
  std::set<std::string> values;
  const auto extras = nlohmann::json::parse(about.extras, nullptr, false);
  if (!extras.is_object() || !extras.contains(name)) return values;
  const nlohmann::json& value = extras[name];
  if (value.is_string()) return listed_texts(value.get<std::string>(), ',');
  if (value.is_array())
    for (const auto& item : value)
      if (item.is_string()) add_text(values, item.get<std::string>());
  return values;
}

std::set<std::string> licence_of(const About& about) {
  std::set<std::string> values;
  add_text(values, about.licence);
  return values;
}

}  // namespace

const SiteFacet kSiteFacetList[kSiteFacets] = {
    {"licence", licence_of},
    {"by", [](const About& about) { return listed_texts(about.creator, ';'); }},
    {"period", [](const About& about) { return from_extras(about, "period"); }},
    {"keyword", [](const About& about) { return from_extras(about, "keywords"); }}};

std::string_view english_site_words() { return built_in_text(site_page_files(), "words.json"); }

SiteWords::SiteWords() {
  const auto english = nlohmann::json::parse(english_site_words());
  for (const auto& [name, text] : english.items()) words_[name] = text.get<std::string>();
}

SiteWords::SiteWords(const std::string& json, const std::string& file) : SiteWords() {
  const auto document = parse_bounded_json(text_bytes(json), file);
  if (!document.is_object()) throw InputError(file, "", "an object of words", "something else");
  for (const auto& [name, text] : document.items()) {
    if (!words_.contains(name))
      throw InputError(file, "/" + name, "a word of the site (texmesh site --print-words)", "another name");
    if (!text.is_string() || text.get<std::string>().size() > kMostWordBytes)
      throw InputError(file, "/" + name, "a text of at most " + std::to_string(kMostWordBytes) + " bytes",
                       text.is_string() ? "a longer one" : "another type");
    words_[name] = text.get<std::string>();
  }
  if (!is_language_tag(words_["language"]))
    throw InputError(file, "/language", "a BCP 47 tag", words_["language"]);
}

std::string SiteWords::operator()(const std::string& name,
                                  const std::map<std::string, std::string>& values) const {
  const auto found = words_.find(name);
  if (found == words_.end()) return name;
  std::string out = found->second;
  for (const auto& [key, value] : values)
    if (const std::size_t at = out.find("{" + key + "}"); at != out.npos)
      out.replace(at, key.size() + 2, value);
  return out;
}

std::string SiteWords::html(const std::string& name, const std::map<std::string, std::string>& values) const {
  return markup_escaped((*this)(name, values));
}

std::string SiteWords::objects(std::size_t count) const {
  return std::to_string(count) + " " + (*this)(count == 1 ? "object" : "objects");
}

std::string facets_of(const SiteObject& object) {
  nlohmann::json list = nlohmann::json::array();
  for (const SiteFacet& facet : kSiteFacetList)
    for (const std::string& value : facet.values(object.about))
      list.push_back(std::string(facet.name) + "=" + value);
  return list.dump();
}

std::string facets_html(const std::vector<SiteObject>& objects, const SiteWords& words) {
  std::string out;
  for (const SiteFacet& facet : kSiteFacetList) {
    std::map<std::string, std::size_t> counts;
    for (const SiteObject& o : objects)
      for (const std::string& value : facet.values(o.about)) ++counts[value];
    const bool tells = std::ranges::any_of(counts, [&](const auto& c) { return c.second < objects.size(); });
    if (!tells) continue;
    std::vector<std::pair<std::string, std::size_t>> common(counts.begin(), counts.end());
    std::ranges::stable_sort(common, std::greater<>(), [](const auto& c) { return c.second; });
    if (common.size() > kMostFacetValues) common.resize(kMostFacetValues);
    std::ranges::sort(common);
    out += fmt::format("<label>{} <select data-facet=\"{}\"><option value=\"\">{}</option>",
                       words.html(facet.name), facet.name, words.html("all"));
    for (const auto& [value, count] : common)
      out += fmt::format("<option value=\"{0}\">{0} ({1})</option>", markup_escaped(value), count);
    out += "</select></label>\n";
  }
  return out.empty() ? "" : "<p class=\"facets\">\n" + out + "</p>\n";
}

}  // namespace texmesh
