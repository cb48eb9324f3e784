#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace texmesh {

// One description per options struct serves the profile reader, the command line, --help, the JSON schema,
// the cache key and `dump`. A struct lists its fields once:
//
//   struct SsfOptions {
//     int scales = 20;
//     static void fields(auto& s, auto&& v) {
//       v("scales", s.scales, Range{1, 64}, "smoothed copies beside the original");
//     }
//   };
//
// Names are snake_case. Field types: bool, int, double, std::string, std::vector<int>, std::vector<double>,
// and enums that have EnumNames. The Range (inclusive) is given for numbers and for the elements of
// vectors; of a text it is that of its bytes, 0 to 200 where none is given.

struct Range {
  double lo, hi;
};

/// Specialise with `static constexpr std::array<std::string_view, N> names`, in the order of
/// the enumerators 0..N-1.
template <class E>
struct EnumNames;

template <class E>
constexpr std::string_view enum_name(E e) {
  return EnumNames<E>::names.at(static_cast<std::size_t>(e));
}

}  // namespace texmesh
