#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/container.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "stages/gltf/glb_container.h"

namespace texmesh::fuzz {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostGrowth = 4096;

Json odd_value(Random& random) {
  static const Json kOdd = Json::parse(
      R"([0,1,2,3,-1,4,255,256,65535,65536,2147483647,2147483648,4294967295,4294967296,9007199254740991,
    18446744073709551615,-9223372036854775808,null,true,false,"","a","../a","/a","data:,",[],{},[[]],1e300,-1e300,1e-300,0.5,5120,5121,
    5123,5125,5126,"POSITION","SCALAR","VEC3","MAT4","TRIANGLES","image/jpeg"])");
  return kOdd[random.below(kOdd.size())];
}

/// Changes a value somewhere below: another value, one of its neighbours', none, twice, other text.
void mutate_json(Json& root, Random& random, const ByteMutator& change) {
  Json* at = &root;
  Json* above = nullptr;
  while (at->is_structured() && !at->empty() && random.below(8) != 0) {
    auto it = at->begin();
    std::advance(it, random.below(at->size()));
    above = at;
    at = &*it;
  }
  switch (random.below(6)) {
    case 0:
      if (above && above->is_array()) {
        const Json copy = *at;
        for (std::size_t n = 1 + random.below(3); n > 0; --n) above->push_back(copy);
        return;
      }
      break;
    case 1:
      if (above) {
        auto it = above->begin();
        std::advance(it, random.below(above->size()));
        const Json copy = *it;
        *at = copy;
        return;
      }
      break;
    case 2:
      if (at->is_array() && !at->empty()) {
        at->erase(random.below(at->size()));
        return;
      }
      if (at->is_object() && !at->empty()) {
        auto it = at->begin();
        std::advance(it, random.below(at->size()));
        at->erase(it);
        return;
      }
      break;
    case 3:
      if (at->is_string()) {
        const auto& text = at->get_ref<const std::string&>();
        const Bytes other = change(to_bytes(text), 64);
        *at = std::string(other.begin(), other.end());
        return;
      }
      if (at->is_number_integer()) {
        *at = at->get<std::uint64_t>() + random.below(9) - 4;  // may wrap
        return;
      }
      break;
    default:
      break;
  }
  *at = odd_value(random);
}

Bytes json_text(const Json& json) {
  return to_bytes(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

Json parse(ByteSpan text) { return Json::parse(text.begin(), text.end(), nullptr, false); }

Bytes mutated_json(ByteSpan text, Random& random, const ByteMutator& change) {
  Json json = parse(text);
  if (json.is_discarded() || random.below(10) == 0) return change({text.begin(), text.end()}, kMostGrowth);
  for (std::size_t n = 1 + random.below(3); n > 0; --n) mutate_json(json, random, change);
  return json_text(json);
}

Bytes mutated_glb(ByteSpan glb, Random& random, const ByteMutator& change) {
  constexpr std::size_t kHead = 20, kChunkHead = 8;
  const std::size_t json_bytes = glb.size() < kHead ? 0 : Choices(glb.subspan(12)).number(4);
  if (glb.size() < kHead || json_bytes > glb.size() - kHead)
    return change({glb.begin(), glb.end()}, kMostGrowth);
  Bytes json(glb.begin() + kHead, glb.begin() + static_cast<std::ptrdiff_t>(kHead + json_bytes));
  Bytes binary;
  if (glb.size() - kHead - json_bytes >= kChunkHead) {
    const ByteSpan rest = glb.subspan(kHead + json_bytes + kChunkHead);
    binary.assign(rest.begin(), rest.end());
  }
  if (binary.empty() || random.below(3) != 0) {
    json = mutated_json(json, random, change);
  } else {
    binary = change(std::move(binary), kMostGrowth);
  }
  return glb_container({reinterpret_cast<const char*>(json.data()), json.size()}, binary);
}

// ---- containers

struct Entry {
  std::string path;
  Bytes bytes;
  std::uint64_t offset = 0;
};

std::vector<Entry> entries_of(ByteSpan container) {
  const auto source = memory_source(container);
  std::vector<Entry> list;
  for (const ContainerEntry& e : read_container(*source))
    list.push_back({e.path, source->read(e.offset, e.bytes), e.offset});
  return list;
}

Bytes container_of(std::vector<Entry>& entries) {
  Bytes out;
  ContainerWriter writer([&](ByteSpan part) { out.insert(out.end(), part.begin(), part.end()); });
  for (const Entry& e : entries) writer.add(e.path, e.bytes);
  writer.finish();
  for (std::size_t k = 0; k < entries.size(); ++k) entries[k].offset = writer.entries()[k].offset;
  return out;
}

void set_reference(Json& reference, const Entry& e) {
  if (!reference.is_object()) return;
  if (reference.contains("offset")) reference["offset"] = e.offset;
  if (reference.contains("bytes")) reference["bytes"] = e.bytes.size();
  if (reference.contains("sha256")) reference["sha256"] = to_hex(sha256(e.bytes));
  if (!reference.contains("headBytes") || !reference["headBytes"].is_number_unsigned()) return;
  const std::size_t head = std::min<std::size_t>(reference["headBytes"].get<std::size_t>(), e.bytes.size());
  reference["headSha256"] = to_hex(sha256(ByteSpan(e.bytes).first(head)));
}

/// The manifest's references, by the entries as they are.
void set_references(Json& manifest, const std::map<std::string, const Entry*>& by_path) {
  for (const auto& [key, path] : std::map<std::string, std::string>{{"index", kIndexPath},
                                                                    {"tables", kTablesPath},
                                                                    {"textures", kTexturesPath},
                                                                    {"quality", kQualityPath},
                                                                    {"provenance", kProvenancePath},
                                                                    {"about", kAboutPath},
                                                                    {"stream", kSplitStreamPath},
                                                                    {"thesis", kThesisPath},
                                                                    {"poster", kPosterPath}})
    if (const auto it = by_path.find(path); it != by_path.end() && manifest.contains(key))
      set_reference(manifest[key], *it->second);
  if (!manifest.contains("scales") || !manifest["scales"].is_object()) return;
  Json& scales = manifest["scales"];
  for (const char* key : {"scale", "offset", "bytes", "sha256"})
    if (!scales.contains(key) || !scales[key].is_array() || scales[key].size() != scales["scale"].size())
      return;
  for (std::size_t k = 0; k < scales["scale"].size(); ++k) {
    if (!scales["scale"][k].is_number_integer()) continue;
    const auto it = by_path.find(mesh_path(scales["scale"][k].get<int>()));
    if (it == by_path.end()) continue;
    scales["offset"][k] = it->second->offset;
    scales["bytes"][k] = it->second->bytes.size();
    scales["sha256"][k] = to_hex(sha256(it->second->bytes));
  }
}

/// A container whose index and manifest say what its entries are, as far as both can be read.
Bytes sealed_container(std::vector<Entry> entries, const std::string& changed) {
  Bytes out = container_of(entries);
  std::map<std::string, const Entry*> by_path;
  for (const Entry& e : entries) by_path[e.path] = &e;
  for (Entry& e : entries) {
    if (e.path != kIndexPath || changed == kIndexPath) continue;
    std::vector<EntryRef> index;
    for (const Entry& other : entries)
      if (other.path != kManifestPath && other.path != kIndexPath)
        index.push_back({other.path, other.offset, other.bytes.size(), sha256(other.bytes)});
    Bytes written = write_index(index);
    if (written.size() == e.bytes.size()) e.bytes = std::move(written);
  }
  for (Entry& e : entries) {
    if (e.path != kManifestPath) continue;
    Json manifest = parse(e.bytes);
    if (!manifest.is_object()) continue;
    set_references(manifest, by_path);
    Bytes text = json_text(manifest);
    // Blanks behind it are allowed: the places of the others stay.
    if (text.size() <= e.bytes.size()) text.resize(e.bytes.size(), ' ');
    e.bytes = std::move(text);
  }
  return container_of(entries);
}

Bytes mutated_container(ByteSpan container, Random& random, const ByteMutator& change) {
  try {
    std::vector<Entry> entries = entries_of(container);
    if (entries.empty()) return change({container.begin(), container.end()}, kMostGrowth);
    Entry& e = entries[random.below(2) ? random.below(entries.size())
                                       : random.below(std::min<std::size_t>(2, entries.size()))];
    e.bytes =
        e.path.ends_with(".json") ? mutated_json(e.bytes, random, change) : change(e.bytes, kMostGrowth);
    if (e.path == kManifestPath && e.bytes.size() < 16000) e.bytes.resize(e.bytes.size() + 64, ' ');
    return sealed_container(std::move(entries), e.path);
  } catch (const FormatError&) {
    return change({container.begin(), container.end()}, kMostGrowth);
  }
}

}  // namespace

Bytes mutate(const Target& target, const Bytes& input, Random& random, const ByteMutator& change) {
  if (random.below(8) == 0) return change(input, kMostGrowth);
  switch (target.shape) {
    case Shape::kJson:
      return mutated_json(input, random, change);
    case Shape::kGlb:
      return mutated_glb(input, random, change);
    case Shape::kContainer:
      return mutated_container(input, random, change);
    case Shape::kBytes:
      break;
  }
  const Bytes changed = change(input, kMostGrowth);
  return target.mend ? target.mend(changed) : changed;
}

ByteMutator plain_mutator(const Target& target, const Bytes& other, Random& random) {
  return [&](Bytes input, std::size_t) {
    for (std::size_t round = 0, rounds = 1 + random.below(4); round < rounds; ++round) {
      const std::size_t at = random.below(input.size() + 1);
      const auto begin = input.begin() + static_cast<std::ptrdiff_t>(at);
      const auto end = begin + static_cast<std::ptrdiff_t>(random.below(input.size() - at + 1));
      switch (random.below(7)) {
        case 0:
          if (begin != input.end()) *begin = static_cast<std::uint8_t>(random.below(256));
          break;
        case 1:
          input.erase(begin, end);
          break;
        case 2:
          input.insert(begin, 1 + random.below(9), static_cast<std::uint8_t>(random.below(2) * 255));
          break;
        case 3: {
          const Bytes part(begin, end);
          input.insert(begin, part.begin(), part.end());
          break;
        }
        case 4:
          std::copy_n(other.begin(), std::min(other.size(), input.size() - at), begin);
          break;
        case 5:
          if (!target.words.empty()) {
            const std::string& word = target.words[random.below(target.words.size())];
            input.insert(begin, word.begin(), word.end());
          }
          break;
        default:
          std::fill(begin, begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, input.size() - at)),
                    0xff);
      }
    }
    return input;
  };
}

}  // namespace texmesh::fuzz
