#pragma once
#include <cstdint>
#include <string>

namespace texmesh {

/// "500MB", "8GiB", "1234". InputError that names the flag.
std::uint64_t parse_bytes(const std::string& text, const std::string& flag);

/// "90d", "12h", "30min", "45s", "45". InputError that names the flag.
std::int64_t parse_seconds(const std::string& text, const std::string& flag);

/// "4", "1.5s", "250ms", in seconds. InputError that names the flag.
double parse_duration(const std::string& text, const std::string& flag);

/// "2Mbit/s", "41.68kB/s", in bytes per second. InputError that names the flag.
double parse_bandwidth(const std::string& text, const std::string& flag);

}  // namespace texmesh
