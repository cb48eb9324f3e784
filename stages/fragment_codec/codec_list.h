#pragma once
// Inside stages only: one maker per codec_*.cpp.
#include <memory>

#include "stages/fragment_codec/fragment_codec.h"

namespace texmesh {

std::unique_ptr<TextureCodec> make_jpeg_codec(const PlaneCoding& plane);
std::unique_ptr<TextureCodec> make_progressive_codec(const PlaneCoding& plane);
std::unique_ptr<TextureCodec> make_webp_codec(const PlaneCoding& plane);
Pixels decode_webp(std::span<const std::uint8_t> file, std::uint64_t max_pixels);

}  // namespace texmesh
