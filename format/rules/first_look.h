#pragma once

namespace texmesh {

/// How posters and viewers look at an object first: a camera of this vertical field of view looks at the
/// middle of the object's box, from this angle round the vertical axis and above the horizontal plane. The
/// sphere round the box touches the shorter sides of the picture, so the object can be turned.
inline constexpr double kFirstLookFovDegrees = 32, kFirstLookAzimuthDegrees = 28,
                        kFirstLookElevationDegrees = 18;

}  // namespace texmesh
