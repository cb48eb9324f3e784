#include "tools/cli/fetch/server_share.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"

namespace texmesh {

nlohmann::ordered_json server_json(const MirrorShare& share) {
  nlohmann::ordered_json j{{"requests", share.requests}, {"bytes", share.bytes}, {"bytes_s", share.bytes_s}};
  if (!share.dropped.empty()) j["dropped"] = share.dropped;
  return j;
}

std::string server_text(const std::string& name, const MirrorShare& share) {
  return fmt::format("  {}: {} requests, {} bytes, {:.0f} kB/s{}\n", name, share.requests,
                     grouped(share.bytes), share.bytes_s / 1e3,
                     share.dropped.empty() ? "" : "; dropped: " + share.dropped);
}

}  // namespace texmesh
