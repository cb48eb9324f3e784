#include "tools/inspect/fragment_files.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/plane_streams.h"
#include "format/base/bounded_json.h"
#include "format/base/bytes.h"
#include "format/base/sha256.h"
#include "format/container/layout.h"
#include "format/rules/allocation.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kNoFile = "0000000000000000";

[[noreturn]] void fail_fragment_index(const std::string& place, const std::string& expected,
                                      const std::string& found) {
  throw FormatError(kFragmentIndexPath, place, expected, found);
}

const Json& list_member(const Json& object, const char* key, const std::string& place) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_array())
    fail_fragment_index(place + "/" + key, "a list", "something else");
  return object[key];
}

std::uint64_t integer(const Json& value, const std::string& place, std::uint64_t largest) {
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > largest)
    fail_fragment_index(place, "an integer in 0 .. " + std::to_string(largest), value.dump().substr(0, 60));
  return value.get<std::uint64_t>();
}

bool is_short_digest(const Json& v) {
  if (!v.is_string() || v.get_ref<const std::string&>().size() != 16) return false;
  return v.get_ref<const std::string&>().find_first_not_of("0123456789abcdef") == std::string::npos;
}

std::string short_digest(const Bytes& bytes) { return to_hex(sha256(bytes)).substr(0, 16); }

FragmentIndex::Rung read_rung(const Json& json, std::size_t fragments, const std::string& place) {
  FragmentIndex::Rung rung;
  const Json& bytes = list_member(json, "bytes", place);
  const Json& digests = list_member(json, "sha256", place);
  if (bytes.size() != fragments || digests.size() != fragments)
    fail_fragment_index(
        place, std::to_string(fragments) + " fragments, as in order",
        std::to_string(bytes.size()) + " sizes, " + std::to_string(digests.size()) + " digests");
  for (std::size_t i = 0; i < fragments; ++i) {
    rung.bytes.push_back(integer(bytes[i], place + "/bytes/" + std::to_string(i), 1ull << 32));
    if (!is_short_digest(digests[i]))
      fail_fragment_index(place + "/sha256/" + std::to_string(i), "16 lower-case hexadecimal digits",
                          digests[i].dump().substr(0, 60));
    rung.digests.push_back(digests[i].get<std::string>());
  }
  return rung;
}

FragmentIndex::Plane read_plane(const Json& json, const std::string& place) {
  FragmentIndex::Plane plane;
  const Json& order = list_member(json, "order", place);
  for (std::size_t i = 0; i < order.size(); ++i)
    plane.order.push_back(
        static_cast<std::uint16_t>(integer(order[i], place + "/order/" + std::to_string(i), 65535)));
  const Json& rungs = list_member(json, "rungs", place);
  for (std::size_t r = 0; r < rungs.size(); ++r)
    plane.rungs.push_back(read_rung(rungs[r], plane.order.size(), place + "/rungs/" + std::to_string(r)));
  return plane;
}

/// Compares the files of one rung (the one added to `streams` last) with the index and the rung's own entry.
void check_rung_files(PackageStore& folder, const std::map<std::string, std::uint64_t>& files,
                      const TextureInfo& info, const PlaneTables& t, const PlaneStreams& streams,
                      std::uint32_t plane, std::uint32_t rung, const FragmentIndex::Rung& stated,
                      Findings& findings) {
  for (std::size_t k = 0; k < t.order.size(); ++k) {
    const std::uint32_t fragment = t.order[k];
    const std::string path = fragment_file_path(plane, rung, fragment, codec_traits(info.codec).extension);
    if (streams.stream(fragment).empty()) {
      findings.require(stated.bytes[k] == 0, "fragment-file", kFragmentIndexPath, path,
                       "0 bytes, as the rung does not store it", std::to_string(stated.bytes[k]));
      continue;
    }
    const Bytes whole = streams.file(fragment);
    const auto file = files.find(path);
    if (!findings.require(file != files.end(), "fragment-file", path, "", "a file", "none")) continue;
    if (!findings.require_equal<std::uint64_t>(whole.size(), file->second, "fragment-file", path, "bytes"))
      continue;
    EntryRef ref;
    ref.path = path;
    ref.bytes = whole.size();
    findings.require(folder.read(ref, 0, ref.bytes) == whole, "fragment-file", path, "",
                     "the fragment of " + info.rungs[rung].path, "other bytes");
    findings.require(stated.bytes[k] == whole.size() && stated.digests[k] == short_digest(whole),
                     "fragment-file", kFragmentIndexPath, path,
                     std::to_string(whole.size()) + " bytes, " + short_digest(whole),
                     std::to_string(stated.bytes[k]) + " bytes, " + stated.digests[k]);
  }
}

}  // namespace

std::string write_fragment_index(const FragmentIndex& index) {
  Json planes = Json::array();
  for (const FragmentIndex::Plane& p : index.planes) {
    Json rungs = Json::array();
    for (const FragmentIndex::Rung& r : p.rungs) rungs.push_back({{"bytes", r.bytes}, {"sha256", r.digests}});
    planes.push_back({{"order", p.order}, {"rungs", rungs}});
  }
  return Json{{"version", 1}, {"planes", planes}}.dump();
}

FragmentIndex read_fragment_index(std::span<const std::uint8_t> json) {
  const Json root = parse_bounded_json(json, kFragmentIndexPath, 16);
  if (!root.is_object() || !root.contains("version") || root["version"] != 1)
    fail_fragment_index("/version", "1", "something else");
  FragmentIndex index;
  const Json& planes = list_member(root, "planes", "");
  for (std::size_t k = 0; k < planes.size(); ++k)
    index.planes.push_back(read_plane(planes[k], "/planes/" + std::to_string(k)));
  return index;
}

FragmentIndex make_fragment_files(PackageReader& package, const FragmentFileSink& sink) {
  FragmentIndex index;
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const PlaneTables& t = package.tables().planes[plane];
    const TextureInfo& info = package.textures()[plane];
    FragmentIndex::Plane entry{t.order, {}};
    PlaneStreams streams(info.codec, t, package.entry(info.tables));
    for (std::uint32_t rung = 0; rung < t.rung_count(); ++rung) {
      streams.add_pack(rung, package.entry(info.rungs[rung]));
      FragmentIndex::Rung files;
      for (const std::uint16_t fragment : t.order) {
        if (streams.stream(fragment).empty()) {  // not stored on this rung
          files.bytes.push_back(0);
          files.digests.push_back(kNoFile);
          continue;
        }
        const Bytes file = streams.file(fragment);
        files.bytes.push_back(file.size());
        files.digests.push_back(short_digest(file));
        sink(fragment_file_path(plane, rung, fragment, codec_traits(info.codec).extension), file);
      }
      entry.rungs.push_back(std::move(files));
    }
    index.planes.push_back(std::move(entry));
  }
  return index;
}

Bytes join_fragment_files(Codec codec, const PlaneTables& t, std::uint32_t plane, std::uint32_t rung,
                          const Bytes& table_stream,
                          const std::function<Bytes(const std::string&)>& read_file) {
  const std::size_t fragments = t.fragment_count();
  Bytes pack;
  for (const std::uint16_t fragment : t.order) {
    const std::uint32_t bytes = t.size_bytes[rung * fragments + fragment];
    if (bytes == 0) continue;
    const std::string path = fragment_file_path(plane, rung, fragment, codec_traits(codec).extension);
    try {
      const Bytes stream =
          split_fragment(codec, table_stream, read_file(path), bytes_to_show(t, rung, fragment) - bytes);
      pack.insert(pack.end(), stream.begin(), stream.end());
    } catch (const FormatError& e) {
      throw FormatError(path, e.place(), e.expected(), e.found());
    }
  }
  return pack;
}

void check_fragment_files(PackageStore& folder, const std::vector<ContainerEntry>& listed,
                          const std::vector<TextureInfo>& textures, const PackageTables& tables,
                          Findings& findings) {
  std::map<std::string, std::uint64_t> files;
  EntryRef index_ref;
  index_ref.path = kFragmentIndexPath;
  for (const ContainerEntry& e : listed) {
    if (e.path == kFragmentIndexPath) index_ref.bytes = e.bytes;
    const EntryName name = parse_entry_path(e.path);
    if (name.kind != EntryKind::kFragmentFile) continue;
    files[e.path] = e.bytes;
    const bool known = name.number < tables.planes.size() &&
                       name.rung < tables.planes[name.number].rung_count() &&
                       name.extension == codec_traits(textures[name.number].codec).extension &&
                       std::count(tables.planes[name.number].order.begin(),
                                  tables.planes[name.number].order.end(), name.fragment) > 0;
    findings.require(known, "fragment-file", e.path, "", "a stored fragment of the package",
                     "none of that name");
  }
  const FragmentIndex index = read_fragment_index(folder.read(index_ref, 0, index_ref.bytes));
  if (!findings.require_equal(tables.planes.size(), index.planes.size(), "fragment-file", kFragmentIndexPath,
                              "/planes"))
    return;
  for (std::uint32_t plane = 0; plane < tables.planes.size(); ++plane) {
    const PlaneTables& t = tables.planes[plane];
    const std::string place = "/planes/" + std::to_string(plane);
    if (!findings.require(
            index.planes[plane].order == t.order && index.planes[plane].rungs.size() == t.rung_count(),
            "fragment-file", kFragmentIndexPath, place, "order and rungs as in the tables", "others"))
      continue;
    const TextureInfo& info = textures[plane];
    PlaneStreams streams(info.codec, t, folder.read(info.tables, 0, info.tables.bytes));
    for (std::uint32_t rung = 0; rung < t.rung_count(); ++rung) {
      streams.add_pack(rung, folder.read(info.rungs[rung], 0, info.rungs[rung].bytes));
      check_rung_files(folder, files, info, t, streams, plane, rung, index.planes[plane].rungs[rung],
                       findings);
    }
  }
}

}  // namespace texmesh
