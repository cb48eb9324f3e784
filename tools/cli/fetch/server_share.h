#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {

// What one of several servers has brought, as fetch and simulate tell it.

/// Of fetch.v1 and simulate.v1 the fields that both have.
nlohmann::ordered_json server_json(const MirrorShare& share);
/// A line.
std::string server_text(const std::string& name, const MirrorShare& share);

}  // namespace texmesh
