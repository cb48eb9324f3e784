// What parent and child tell each other about files.
#include <nlohmann/json.hpp>

#include "pipeline/compile/worker.h"
#include "pipeline/io/wire_text.h"

namespace texmesh {
namespace {
using Json = nlohmann::ordered_json;
}

std::string files_to_json(const std::vector<FileRequest>& files) {
  Json list = Json::array();
  for (const FileRequest& r : files)
    list.push_back({to_wire(r.uri), r.found, to_hex(r.digest), r.bytes, r.stamp.device, r.stamp.inode,
                    r.stamp.bytes, r.stamp.modified_ns, r.stamp.changed_ns});
  return list.dump();
}

std::vector<FileRequest> files_from_json(const std::string& json) {
  std::vector<FileRequest> files;
  const Json list = Json::parse(json, nullptr, false);
  if (!list.is_array()) return files;
  for (const Json& j : list) {
    FileRequest r;
    if (!j.is_array() || j.size() != 9 || !j[0].is_string() || !j[2].is_string() ||
        !from_hex(j[2].get<std::string>(), r.digest))
      continue;
    r.uri = from_wire(j[0].get<std::string>());
    r.found = j[1].get<bool>();
    r.bytes = j[3].get<std::uint64_t>();
    r.stamp = {j[4].get<std::uint64_t>(), j[5].get<std::uint64_t>(), j[6].get<std::uint64_t>(),
               j[7].get<std::int64_t>(), j[8].get<std::int64_t>()};
    files.push_back(std::move(r));
  }
  return files;
}

const char* result_name(ModelResult r) {
  switch (r) {
    case ModelResult::kOk:
      return "ok";
    case ModelResult::kUnchanged:
      return "unchanged";
    case ModelResult::kFailed:
      return "failed";
    case ModelResult::kInternal:
      return "internal-error";
    default:
      return "cancelled";
  }
}

}  // namespace texmesh
