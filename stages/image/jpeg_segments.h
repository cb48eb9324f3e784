#pragma once

#include "format/base/bytes.h"

namespace texmesh {

/// A frame header (SOF), of any coding.
inline bool is_jpeg_frame(std::uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

/// Calls f(marker, body) for every whole segment in front of a JPEG's first scan, as long as segments follow
/// each other; what is no JPEG has none. ITU-T T.81, annex B.
void for_each_jpeg_segment(ByteSpan jpeg, const auto& f) {
  constexpr std::uint8_t kFill = 0xff, kScan = 0xda, kEndOfImage = 0xd9;
  for (std::size_t at = 2; at + 4 <= jpeg.size() && jpeg[at] == 0xff;) {
    const std::uint8_t marker = jpeg[at + 1];
    if (marker == kFill) {
      ++at;
      continue;
    }
    const std::size_t bytes = std::size_t{jpeg[at + 2]} << 8 | jpeg[at + 3];
    if (marker == kScan || marker == kEndOfImage || bytes < 2 || bytes > jpeg.size() - at - 2) return;
    f(marker, jpeg.subspan(at + 4, bytes - 2));
    at += 2 + bytes;
  }
}

}  // namespace texmesh
