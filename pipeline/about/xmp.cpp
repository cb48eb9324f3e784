#include "pipeline/about/xmp.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "pipeline/about/source_fields.h"

namespace texmesh {
namespace {

using Json = nlohmann::json;
constexpr std::size_t kMaxTexts = 64;
constexpr const char* kDublinCore = "http://purl.org/dc/elements/1.1/";
constexpr const char* kXmpBasic = "http://ns.adobe.com/xap/1.0/";
constexpr const char* kXmpRights = "http://ns.adobe.com/xap/1.0/rights/";

/// The usual prefix of a namespace.
const std::map<std::string, std::string> kPrefixes{
    {kDublinCore, "dc"}, {kXmpBasic, "xmp"}, {kXmpRights, "xmpRights"}};

void collect_texts(const Json& value, std::vector<std::string>& texts);

/// rdf:_1, rdf:_2 ... in this order; of an rdf:Alt the one language to show.
void collect_members(const Json& object, std::vector<std::string>& texts) {
  std::vector<const Json*> members;
  for (std::size_t i = 1; i <= kMaxTexts; ++i) {
    const auto it = object.find("rdf:_" + std::to_string(i));
    if (it == object.end()) break;
    members.push_back(&*it);
  }
  const auto type = object.find("@type");
  if (type == object.end() || *type != "rdf:Alt") {
    for (const Json* member : members) collect_texts(*member, texts);
    return;
  }
  const auto rank = [](const Json& member) {
    const auto language = member.is_object() ? member.find("@language") : member.end();
    if (language == member.end() || !language->is_string() || *language == "x-default") return 0;
    return language->get_ref<const std::string&>().starts_with("en") ? 1 : 2;
  };
  const Json* best = nullptr;
  for (const Json* member : members)
    if (!best || rank(*member) < rank(*best)) best = member;
  if (best) collect_texts(*best, texts);
}

/// The texts of a value, whatever it is wrapped in.
void collect_texts(const Json& value, std::vector<std::string>& texts) {
  if (texts.size() == kMaxTexts) return;
  if (value.is_string()) texts.push_back(value.get<std::string>());
  if (value.is_number()) texts.push_back(value.dump());
  if (value.is_array())
    for (const Json& element : value) collect_texts(element, texts);
  if (!value.is_object()) return;
  for (const char* key : {"@value", "@list", "@set", "@id"})
    if (const auto it = value.find(key); it != value.end()) return collect_texts(*it, texts);
  collect_members(value, texts);
}

/// A packet with the prefixes of its @context.
class Packet {
 public:
  explicit Packet(const Json& json) : json_(json) {
    prefixes_ = kPrefixes;
    const auto context = json.find("@context");
    if (context == json.end() || !context->is_object()) return;
    for (const auto& [prefix, name] : context->items())
      if (name.is_string() && kPrefixes.contains(name.get<std::string>()))
        prefixes_[name.get<std::string>()] = prefix;
  }
  std::string key(const std::string& name_space, const std::string& name) const {
    return prefixes_.at(name_space) + ":" + name;
  }
  std::vector<std::string> texts(const std::string& name_space, const std::string& name) const {
    std::vector<std::string> texts;
    const auto it = json_.find(key(name_space, name));
    if (it != json_.end()) collect_texts(*it, texts);
    return texts;
  }

 private:
  const Json& json_;
  std::map<std::string, std::string> prefixes_;
};

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : "; ") + text;
  return all;
}

/// dc:rights and the terms are a licence where they name one, otherwise a line to show. A web statement says
/// where the licence can be read.
void apply_rights(About& about, const Packet& packet, const std::string& place, Notes& notes) {
  Notes ignored;
  for (const std::string& text : packet.texts(kDublinCore, "rights")) {
    About said;
    ignored.clear();
    set_source_licence(said, text, place, ignored);
    if (said.licence.empty()) continue;
    if (ignored.empty())
      about.licence = said.licence, about.licence_url = said.licence_url;
    else
      about.attribution = said.licence;
  }
  const std::string owner = joined(packet.texts(kXmpRights, "Owner"));
  if (about.attribution.empty() && !owner.empty())
    set_source_field(about, "attribution", owner, place, notes);
  const std::string terms = joined(packet.texts(kXmpRights, "UsageTerms"));
  if (!terms.empty()) set_source_licence(about, terms, place, notes);
  for (const std::string& url : packet.texts(kXmpRights, "WebStatement")) {
    if (url.size() > kMaxAboutTextBytes || !is_web_url(url)) continue;
    if (about.licence.empty()) about.licence = url;
    about.licence_url = url;
    break;
  }
}

void add_items(std::vector<NamedText>& list, const std::string& name, const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    const NamedText item{name, clean_about_text(text, kMaxAboutValueBytes)};
    if (!item.text.empty() && list.size() < kMaxAboutList &&
        std::find(list.begin(), list.end(), item) == list.end())
      list.push_back(item);
  }
}

}  // namespace

void apply_xmp(About& about, const Json& json, const std::string& place, Notes& notes) {
  if (!json.is_object()) return;
  const Packet packet(json);
  for (const char* name : {"title", "creator", "description"})
    if (const std::string text = joined(packet.texts(kDublinCore, name)); !text.empty())
      set_source_field(about, name, text, place, notes);
  apply_rights(about, packet, place, notes);
  for (const std::string& url : packet.texts(kDublinCore, "source"))
    if (url.size() <= kMaxAboutTextBytes && is_web_url(url)) about.source_url = url;
  add_items(about.identifiers, "dc:identifier", packet.texts(kDublinCore, "identifier"));
  add_items(about.dates, "dc:date", packet.texts(kDublinCore, "date"));
  add_items(about.dates, "xmp:CreateDate", packet.texts(kXmpBasic, "CreateDate"));
}

nlohmann::ordered_json xmp_packet(const About& about, nlohmann::ordered_json packet) {
  using Ordered = nlohmann::ordered_json;
  if (!packet.is_object()) packet = Ordered::object();
  About said;
  Notes ignored;
  const Json before = Json::parse(packet.dump());
  apply_xmp(said, before, "", ignored);
  const Packet names(before);
  const auto set = [&](const char* name_space, const char* name, const std::string& text,
                       const std::string& already, const Ordered& value) {
    if (text.empty() || text == already) return;
    const std::string key = names.key(name_space, name), prefix = key.substr(0, key.find(':'));
    if (!packet.contains("@context") || !packet["@context"].is_object())
      packet["@context"] = Ordered::object();
    packet["@context"][prefix] = name_space;
    packet[key] = value;
  };
  const auto in_default_language = [](const std::string& text) {
    return Ordered{{"@type", "rdf:Alt"}, {"rdf:_1", {{"@language", "x-default"}, {"@value", text}}}};
  };
  set(kDublinCore, "title", about.title, said.title, in_default_language(about.title));
  set(kDublinCore, "creator", about.creator, said.creator, {{"@list", Ordered::array({about.creator})}});
  set(kDublinCore, "description", about.description, said.description,
      in_default_language(about.description));
  set(kDublinCore, "rights", about.attribution, said.attribution, in_default_language(about.attribution));
  set(kDublinCore, "source", about.source_url, said.source_url, about.source_url);
  set(kXmpRights, "UsageTerms", about.licence, said.licence, in_default_language(about.licence));
  set(kXmpRights, "WebStatement", about.licence_url, said.licence_url, about.licence_url);
  Ordered identifiers = Ordered::array();
  for (const NamedText& item : about.identifiers)
    identifiers.push_back(item.name == "dc:identifier" ? item.text : item.name + ":" + item.text);
  if (!identifiers.empty() && about.identifiers != said.identifiers)
    set(kDublinCore, "identifier", "identifiers", "", {{"@set", identifiers}});
  if (packet.contains("@context") && packet.dump().find("\"rdf:") != std::string::npos)
    packet["@context"]["rdf"] = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";
  return packet;
}

}  // namespace texmesh
