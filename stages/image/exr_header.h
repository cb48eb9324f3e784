#pragma once
// Inside stages: the attributes in front of an EXR's pixels (OpenEXR, "File Layout").
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "format/base/bytes.h"

namespace texmesh {

struct ExrAttribute {
  std::string_view name, type;
  ByteSpan value;
};

/// Text up to a zero byte, which `at` is then behind; nothing where there is none within EXR's 255.
inline std::string_view exr_text(ByteSpan bytes, std::size_t& at) {
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size()));
  const auto end = std::find(begin, begin + std::min<std::ptrdiff_t>(256, bytes.end() - begin), 0);
  if (end == bytes.end() || *end != 0) return {};
  at += static_cast<std::size_t>(end - begin) + 1;
  return {reinterpret_cast<const char*>(bytes.data()) + (begin - bytes.begin()),
          static_cast<std::size_t>(end - begin)};
}

/// Calls f(part, attribute) for the attributes of the parts, in order, up to one that is not whole. False
/// where an attribute claims to be longer than the file.
template <class F>
bool for_each_exr_attribute(ByteSpan exr, const F& f) {
  constexpr std::size_t kVersionAt = 4, kParts = 0x1000, kHead = 8;
  if (exr.size() < kHead) return true;
  const bool many = (exr[kVersionAt + 1] << 8) & kParts;
  std::size_t part = 0;
  for (std::size_t at = kHead; at < exr.size();) {
    if (exr[at] == 0) {  // the end of a part's header; two of them end the headers
      if (!many || ++at >= exr.size() || exr[at] == 0) return true;
      ++part;
    }
    const std::string_view name = exr_text(exr, at), type = exr_text(exr, at);
    if (name.empty() || type.empty() || exr.size() - at < 4) return true;
    BytesIn size(exr.subspan(at, 4), "EXR");
    const std::size_t bytes = size.u32();
    at += 4;
    if (bytes > exr.size() - at) return false;
    f(part, ExrAttribute{name, type, exr.subspan(at, bytes)});
    at += bytes;
  }
  return true;
}

}  // namespace texmesh
