#include "pipeline/about/gltf_about.h"

#include <nlohmann/json.hpp>

#include "pipeline/about/source_fields.h"

namespace texmesh {
namespace {

using GltfJson = nlohmann::json;
using Ordered = nlohmann::ordered_json;

constexpr std::size_t kMaxTexts = 64;
constexpr const char* kDublinCore = "http://purl.org/dc/elements/1.1/";
constexpr const char* kXmpBasic = "http://ns.adobe.com/xap/1.0/";
constexpr const char* kXmpRights = "http://ns.adobe.com/xap/1.0/rights/";

/// The usual prefix of a namespace.
const std::map<std::string, std::string> kPrefixes{
    {kDublinCore, "dc"}, {kXmpBasic, "xmp"}, {kXmpRights, "xmpRights"}};

void collect_texts(const GltfJson& value, std::vector<std::string>& texts);

/// rdf:_1, rdf:_2 ... in this order; of an rdf:Alt the one language to show.
void collect_members(const GltfJson& object, std::vector<std::string>& texts) {
  std::vector<const GltfJson*> members;
  for (std::size_t i = 1; i <= kMaxTexts; ++i) {
    const auto it = object.find("rdf:_" + std::to_string(i));
    if (it == object.end()) break;
    members.push_back(&*it);
  }
  const auto type = object.find("@type");
  if (type == object.end() || *type != "rdf:Alt") {
    for (const GltfJson* member : members) collect_texts(*member, texts);
    return;
  }
  const auto rank = [](const GltfJson& member) {
    const auto language = member.is_object() ? member.find("@language") : member.end();
    if (language == member.end() || !language->is_string() || *language == "x-default") return 0;
    return language->get_ref<const std::string&>().starts_with("en") ? 1 : 2;
  };
  const GltfJson* best = nullptr;
  for (const GltfJson* member : members)
    if (!best || rank(*member) < rank(*best)) best = member;
  if (best) collect_texts(*best, texts);
}

/// The texts of a value, whatever it is wrapped in.
void collect_texts(const GltfJson& value, std::vector<std::string>& texts) {
  if (texts.size() == kMaxTexts) return;
  if (value.is_string()) texts.push_back(value.get<std::string>());
  if (value.is_number()) texts.push_back(value.dump());
  if (value.is_array())
    for (const GltfJson& element : value) collect_texts(element, texts);
  if (!value.is_object()) return;
  for (const char* key : {"@value", "@list", "@set", "@id"})
    if (const auto it = value.find(key); it != value.end()) return collect_texts(*it, texts);
  collect_members(value, texts);
}

/// A packet with the prefixes of its @context.
class Packet {
 public:
  explicit Packet(const GltfJson& json) : json_(json) {
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
  const GltfJson& json_;
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
  for (const std::string& text : texts) add_about_value(list, name, text);
}

constexpr const char* kXmpExtension = "KHR_xmp_json_ld";
constexpr const char* kPackets = "/extensions/KHR_xmp_json_ld/packets";
constexpr const char* kArrays[] = {"scenes",   "nodes",  "meshes",   "materials",
                                   "textures", "images", "samplers", "cameras"};
constexpr std::size_t kRoomForCuts = 4096;  // of About::source, for the list of what does not fit
constexpr int kMaxKeptDepth = 48;           // of a value; about.json has 64 levels in all

/// What stands at a JSON pointer of names; null where nothing does.
const GltfJson* find(const GltfJson& document, const std::string& pointer) {
  const GltfJson::json_pointer place(pointer);
  return document.contains(place) ? &document.at(place) : nullptr;
}

/// The number of the packet that an object refers to.
std::optional<std::size_t> packet_number(const GltfJson* object) {
  const GltfJson* packet = object ? find(*object, "/extensions/KHR_xmp_json_ld/packet") : nullptr;
  return packet && packet->is_number_unsigned() ? std::optional(packet->get<std::size_t>()) : std::nullopt;
}

std::string text_of(const GltfJson* value) {
  return value && value->is_string() ? value->get<std::string>() : std::string();
}

int depth_of(const GltfJson& value) {
  int deepest = 0;
  if (value.is_structured())
    for (const GltfJson& child : value) deepest = std::max(deepest, depth_of(child));
  return deepest + 1;
}

/// Keeps values until the room for them is used up.
class KeptSource {
 public:
  explicit KeptSource(const std::string& format) { source_["format"] = format; }

  void keep(const char* name, const GltfJson& value, const std::string& pointer) {
    if (fits(value, pointer)) source_[name] = Ordered(value);
  }
  void keep_in_list(const char* name, const char* key, const GltfJson& value, const std::string& pointer,
                    const std::string& path) {
    if (fits(value, pointer)) source_[name].push_back({{"path", path}, {key, Ordered(value)}});
  }
  std::string finish(Notes& notes) {
    if (cuts_ == 0) return source_.dump();
    if (cuts_ > named_.size()) named_.push_back("and " + std::to_string(cuts_ - named_.size()) + " more");
    source_["cut"] = named_;
    add_info(notes, "metadata-cut", named_.front(),
             "the source says more about itself than the " + std::to_string(kMaxAboutSourceBytes) +
                 " bytes of about.json hold; " + std::to_string(cuts_) + " values are left out");
    return source_.dump();
  }

 private:
  bool fits(const GltfJson& value, const std::string& pointer) {
    const std::size_t bytes = value.dump().size(), with_names = bytes + pointer.size() + 64;
    if (with_names <= room_ && depth_of(value) <= kMaxKeptDepth) {
      room_ -= with_names;
      return true;
    }
    if (++cuts_ < kMaxAboutList)
      named_.push_back(clean_about_text(pointer, kMaxAboutNameBytes) + ": " + std::to_string(bytes) +
                       " bytes");
    return false;
  }

  Ordered source_;
  std::size_t room_ = kMaxAboutSourceBytes - kRoomForCuts, cuts_ = 0;
  std::vector<std::string> named_;
};

/// Calls f(object, JSON pointer) for the root and every element of the arrays that a model is made of.
template <class F>
void for_each_object(const GltfJson& document, const F& f) {
  f(document, std::string());
  for (const char* name : kArrays) {
    const GltfJson* list = find(document, "/" + std::string(name));
    if (!list || !list->is_array()) continue;
    for (std::size_t i = 0; i < list->size(); ++i)
      f((*list)[i], "/" + std::string(name) + "/" + std::to_string(i));
  }
}

/// Names that say what a coordinate is do not count: glTF has metres and y up.
void apply_extras(About& about, const GltfJson* extras, const std::string& place, Notes& notes) {
  if (!extras || !extras->is_object()) return;
  for (const auto& [name, value] : extras->items()) {
    if (!value.is_string() && !value.is_number_unsigned()) continue;
    set_source_field(about, name, value.is_string() ? value.get<std::string>() : value.dump(), place, notes);
  }
}

std::string keep_source(const GltfJson& document, const std::string& format, Notes& notes) {
  KeptSource kept(format);
  if (const GltfJson* asset = find(document, "/asset")) kept.keep("asset", *asset, "/asset");
  if (const GltfJson* packets = find(document, kPackets); packets && packets->is_array() && !packets->empty())
    kept.keep("xmpPackets", *packets, kPackets);
  for_each_object(document, [&](const GltfJson& object, const std::string& path) {
    if (const auto packet = packet_number(&object))
      kept.keep_in_list("xmp", "packet", *packet, path + "/extensions/KHR_xmp_json_ld", path);
  });
  for_each_object(document, [&](const GltfJson& object, const std::string& path) {
    if (const GltfJson* extras = find(object, "/extras"))
      kept.keep_in_list("extras", "value", *extras, path + "/extras", path);
  });
  return kept.finish(notes);
}

/// The member, made an object where it is none. Not to be kept: an ordered_json moves its members when one is
/// added.
Ordered& member_object(Ordered& parent, const char* name) {
  Ordered& found = parent[name];
  if (!found.is_object()) found = Ordered::object();
  return found;
}

/// glTF has metres and y up, and no place for anything else.
void write_coordinates(const About& about, Ordered& root) {
  Ordered said = Ordered::object();
  if (about.metres_per_unit > 0 && about.metres_per_unit != 1)
    said["unit"] = {{"name", about.unit}, {"metres", about.metres_per_unit}};
  if (!about.up_axis.empty() && about.up_axis != "y") said["upAxis"] = about.up_axis;
  if (!about.crs.empty()) said["coordinateReference"]["text"] = about.crs;
  if (about.epsg > 0) said["coordinateReference"]["epsg"] = about.epsg;
  if (!said.empty()) member_object(root, "extras")["texmesh"] = said;
}

}  // namespace

void apply_xmp(About& about, const GltfJson& json, const std::string& place, Notes& notes) {
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
  if (!packet.is_object()) packet = Ordered::object();
  About said;
  Notes ignored;
  const GltfJson before(packet);
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

About about_from_gltf(const GltfJson& document, const std::string& format, Notes& notes) {
  About about;
  const GltfJson* asset = find(document, "/asset");
  const GltfJson *scenes = find(document, "/scenes"), *number = find(document, "/scene");
  const std::size_t shown = number && number->is_number_unsigned() ? number->get<std::size_t>() : 0;
  const GltfJson* scene =
      scenes && scenes->is_array() && shown < scenes->size() ? &(*scenes)[shown] : nullptr;
  if (asset) {
    about.attribution = clean_about_text(text_of(find(*asset, "/copyright")), kMaxAboutTextBytes);
    apply_extras(about, find(*asset, "/extras"), "/asset/extras", notes);
  }
  apply_extras(about, find(document, "/extras"), "/extras", notes);
  if (scene) apply_extras(about, find(*scene, "/extras"), "/scenes/extras", notes);
  const GltfJson* packets = find(document, kPackets);
  const auto packet = packet_number(asset) ? packet_number(asset) : packet_number(scene);
  if (packets && packets->is_array() && packet && *packet < packets->size())
    apply_xmp(about, (*packets)[*packet], "KHR_xmp_json_ld", notes);
  about.unit = "metre";
  about.metres_per_unit = 1;
  about.up_axis = "y";
  about.source = keep_source(document, format, notes);
  return about;
}

void write_gltf_about(const About& about, Ordered& root) {
  write_coordinates(about, root);
  const Ordered source = about.source.empty() ? Ordered::object() : Ordered::parse(about.source);
  const Ordered from = source.value("asset", Ordered::object());
  if (const std::string line = copyright_line(about); !line.empty())
    member_object(root, "asset")["copyright"] = line;
  if (from.is_object() && from.contains("extras")) member_object(root, "asset")["extras"] = from["extras"];

  Ordered packets = source.value("xmpPackets", Ordered::array());
  if (!packets.is_array()) packets = Ordered::array();
  const GltfJson from_unordered(from);
  std::size_t shown = packet_number(&from_unordered).value_or(packets.size());
  const Ordered before = shown < packets.size() ? packets[shown] : Ordered::object();
  const Ordered after = xmp_packet(about, before);
  if (after != before) {
    shown = packets.size();
    packets.push_back(after);
  }
  if (packets.empty()) return;
  member_object(member_object(root, "extensions"), kXmpExtension)["packets"] = packets;
  if (shown < packets.size())
    member_object(member_object(member_object(root, "asset"), "extensions"), kXmpExtension)["packet"] = shown;
  Ordered used = root.value("extensionsUsed", Ordered::array());
  if (!used.is_array()) used = Ordered::array();
  if (std::find(used.begin(), used.end(), Ordered(kXmpExtension)) == used.end())
    used.push_back(kXmpExtension);
  root["extensionsUsed"] = used;
}

std::vector<About> about_choices(const About& about) {
  About fields = about;
  fields.source.clear();
  About least;
  least.title = about.title;
  least.creator = about.creator;
  least.attribution = about.attribution;
  least.licence = about.licence;
  least.licence_url = about.licence_url;
  return {about, std::move(fields), std::move(least)};
}

About about_within(const About& about, std::uint64_t bytes) {
  std::vector<About> choices = about_choices(about);
  const auto fits = [bytes](const About& choice) {
    Ordered root = Ordered::object();
    write_gltf_about(choice, root);
    return root.dump().size() <= bytes;
  };
  const auto found = std::ranges::find_if(choices, fits);
  return found == choices.end() ? std::move(choices.back()) : std::move(*found);
}

}  // namespace texmesh
