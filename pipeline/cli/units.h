#pragma once
#include <cstdint>
#include <string>

namespace texmesh {

/// "500MB", "8GiB", "1234". InputError that names the flag.
std::uint64_t parse_bytes(const std::string& text, const std::string& flag);

/// "90d", "12h", "30min", "45s", "45". InputError that names the flag.
std::int64_t parse_seconds(const std::string& text, const std::string& flag);

}  // namespace texmesh
