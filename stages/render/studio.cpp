// The environment of all measurements.
#include "stages/render/environment.h"
#include "stages/render/render_math.h"

namespace texmesh {
namespace {

/// A soft box: a lobe exp(sharpness (cos - 1)) around a direction.
struct SoftBox {
  Vec3f direction;  // not unit
  float sharpness;
  Vec3f peak;
};

// Their sum is grey. The main box stands where the key light comes from.
constexpr SoftBox kBoxes[] = {{{0.62f, 0.72f, 0.55f}, 26, {4.6f, 4.5f, 4.35f}},
                              {{-0.85f, 0.35f, 0.45f}, 14, {1.15f, 1.2f, 1.3f}},
                              {{-0.15f, 0.45f, -0.9f}, 18, {2.15f, 2.2f, 2.3f}}};
constexpr Vec3f kZenith{0.33f, 0.35f, 0.39f}, kHorizon{0.45f, 0.44f, 0.43f}, kGround{0.255f, 0.235f, 0.205f};
constexpr float kLog2E = 1.44269504f;

float lobe(Vec3f direction, Vec3f axis, float sharpness) {
  return exp2_of(kLog2E * sharpness * (dot(direction, normalized(axis)) - 1));
}

}  // namespace

Vec3f studio_radiance(Vec3f direction) {
  const float up = clamped(direction.y, -1, 1);
  // The sky turns into the ground within about 20 degrees around the horizon.
  const float t = render::saturated((up + 0.18f) / 0.36f), sky = t * t * (3 - 2 * t);
  const float high = render::saturated(up);
  const Vec3f above = kHorizon + (kZenith - kHorizon) * high;
  Vec3f sum = kGround + (above - kGround) * sky;
  for (const SoftBox& box : kBoxes) sum = sum + box.peak * lobe(direction, box.direction, box.sharpness);
  return sum;
}

KeyLight studio_key_light() { return {normalized(Vec3f{0.62f, 0.72f, 0.55f}), Vec3f{1.02f, 1.0f, 0.96f}}; }

}  // namespace texmesh
