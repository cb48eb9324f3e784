#pragma once
// Inside this room only: one maker per codec_*.cpp.
#include <memory>

#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {

std::unique_ptr<TextureCodec> make_jpeg_codec(const PlaneCoding& plane);
std::unique_ptr<TextureCodec> make_progressive_codec(const PlaneCoding& plane);
std::unique_ptr<TextureCodec> make_webp_codec(const PlaneCoding& plane);
/// How a plane's JPEGs are coded.
JpegKind jpeg_kind(const PlaneCoding& plane, int quality);
/// Of baseline JPEGs, whose rungs need not be alike: at kFinestQuality three channels are coded as they are.
JpegKind baseline_kind(const PlaneCoding& plane, int quality);

}  // namespace texmesh
