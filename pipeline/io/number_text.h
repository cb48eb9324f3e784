#pragma once
#include <cstdint>
#include <string>

namespace texmesh {

// Numbers for people. Units are decimal.

/// "12 B", "340 kB", "1.23 MB": at most three digits.
std::string format_bytes(std::uint64_t bytes);
/// "3.4 s", "2 min 10 s", "1 h 5 min".
std::string format_seconds(double seconds);
/// Thousands of bytes, one digit after the point and no unit: for columns.
std::string kilobytes(std::uint64_t bytes);
/// 1234567 -> "1 234 567": groups of three digits.
std::string grouped(std::uint64_t value);
/// The same with narrow blanks that break no line: for pages.
std::string thin_grouped(std::uint64_t value);
/// `digits` significant digits, no exponent between 1e-4 and 1e9, no trailing zeros: 0.01235, 153.2, 1e+09.
std::string shortest(double value, int digits = 4);
/// `digits` digits after the point.
std::string fixed(double value, int digits);

}  // namespace texmesh
