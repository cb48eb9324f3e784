#include "examples/scan_model.h"
#include "examples/scan_noise.h"
#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kOwlUnit = 0.1;  // object units of a length of 1 below: the owl is about 3 high

double ellipsoid(Vec3d p, Vec3d centre, Vec3d radii) {
  const Vec3d d = p - centre, once{d.x / radii.x, d.y / radii.y, d.z / radii.z};
  const Vec3d twice{once.x / radii.x, once.y / radii.y, once.z / radii.z};
  const double k = length(once);
  return k * (k - 1) / std::max(1e-9, length(twice));
}

// The smaller of both; where they differ by less than `k`, their edge is rounded.
double joined(double a, double b, double k) {
  const double h = std::max(k - std::fabs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k / 4;
}

double disc_distance(double x, double y) { return std::sqrt(x * x + y * y); }

/// Feathers that lie on each other as tiles do; `v` counts rows downwards, `u` feathers along a row.
struct Feather {
  double inside = 0;  // 0 at the rim, 1 in the middle of the root
  double across = 0, down = 0;
  double tone = 0;  // 0 .. 1, of this feather
};
Feather feather_at(double u, double v, double around, std::uint32_t seed) {
  Feather f;
  const double row = std::floor(v);
  for (double j = row; j <= row + 1; ++j) {
    const double shift = std::fabs(j - 2 * std::floor(j / 2)) * 0.5;
    double column = std::floor(u - shift + 0.5);
    f.across = (u - shift - column) / 0.58;
    f.down = v - j;
    f.inside = 1 - disc_distance(f.across, f.down);
    // The last feather of a row is the first one.
    column -= around * std::floor(column / around);
    f.tone = hash01(static_cast<std::uint32_t>(static_cast<std::int64_t>(column)),
                    static_cast<std::uint32_t>(static_cast<std::int64_t>(j)), 8, seed);
    if (f.inside > 0) break;
  }
  f.inside = clamp01(f.inside);
  return f;
}

// Cream, feathers, wings, beak: what potters of four towns have.
constexpr Vec3d kGlazes[4][4] = {
    {{0.90, 0.84, 0.71}, {0.72, 0.36, 0.20}, {0.13, 0.25, 0.43}, {0.87, 0.60, 0.17}},
    {{0.88, 0.86, 0.78}, {0.24, 0.47, 0.43}, {0.42, 0.20, 0.16}, {0.88, 0.66, 0.28}},
    {{0.92, 0.87, 0.76}, {0.79, 0.55, 0.20}, {0.34, 0.27, 0.22}, {0.80, 0.36, 0.18}},
    {{0.87, 0.85, 0.82}, {0.30, 0.44, 0.62}, {0.16, 0.20, 0.34}, {0.91, 0.70, 0.30}},
};
constexpr Vec3d kInk{0.10, 0.085, 0.08};

/// A glazed owl of clay that stands on a plinth, looks along +z and has its up side at +y.
class OwlShape final : public ScanShape {
 public:
  explicit OwlShape(std::uint32_t seed) : seed_(seed * 1000003u + 71u) {
    turn_ = mix(-0.30, 0.30, hash01(1, 0, 0, seed_));
    girth_ = mix(0.94, 1.08, hash01(2, 0, 0, seed_));
    tufts_ = mix(0.24, 0.36, hash01(3, 0, 0, seed_));
    std::copy_n(kGlazes[(seed - 1) % 4], 4, glaze_.begin());
  }

  Vec3d point(Vec3d direction) const override {
    // The owl can be seen whole from its middle: the outermost crossing is the only one, but for creases.
    constexpr int kSteps = 48;
    constexpr double kReach = 2.2;
    const auto value = [&](double r) { return form(owl_space(kMiddle + direction * r)); };
    double hi = kReach;
    while (hi > 0.05 && value(hi - kReach / kSteps) > 0) hi -= kReach / kSteps;
    double lo = hi - kReach / kSteps;
    for (int i = 0; i < 40; ++i) (value((lo + hi) / 2) > 0 ? hi : lo) = (lo + hi) / 2;
    const Vec3d p = kMiddle + direction * lo;
    return (p + direction * (paint(owl_space(p), 0.004).relief)) * kOwlUnit;
  }

  ShapeSample sample(Vec3d position, Vec3d normal, double finest) const override {
    const Vec3d p = position * (1 / kOwlUnit);
    const Paint painted = paint(owl_space(p), std::max(1e-5, finest / kOwlUnit));
    const int octaves =
        std::clamp(static_cast<int>(portable::log(kOwlUnit / (12 * finest)) / portable::log(2.0)), 2, 9);
    const double fine = fractal(p * 6, seed_ + 60, octaves, 0.6);
    const double crackle = smoothstep(0.955, 0.985, ridged(p * 5, seed_ + 90, 3));
    const double pits = spots(p * 30, seed_ + 110, 0.22);
    // The glaze is thin, and lost at places, on edges and where hands have held it.
    const double worn = smoothstep(0.50, 0.60, fractal(p * 1.9, seed_ + 120, 5) + 0.25 * fine);
    Vec3d c = painted.colour * (1 + 0.16 * fine);
    c = c * (1 + 0.10 * fractal(p * 1.2, seed_ + 130, 3));
    c = mix(c, Vec3d{0.66, 0.42, 0.30} * (1 + 0.3 * fine), 0.85 * worn);
    c = mix(c, kInk, 0.35 * crackle + 0.45 * smoothstep(0.1, 0.6, pits));

    ShapeSample s;
    s.height = kOwlUnit * (0.004 * fine - 0.006 * crackle - 0.006 * smoothstep(0, 0.7, pits) - 0.004 * worn);
    s.occlusion = clamp01(painted.open - 0.25 * crackle);
    s.roughness = clamp01(0.34 + 0.45 * worn + 0.15 * fine);
    const double light = 0.84 + 0.16 * dot(normal, normalized(Vec3d{0.35, 0.85, 0.4}));
    s.colour = c * (light * (0.5 + 0.5 * s.occlusion));
    return s;
  }

 private:
  struct Paint {
    Vec3d colour;
    double relief = 0, open = 1;  // open: 0 in a groove
  };
  static constexpr Vec3d kMiddle{0, -0.15, 0};

  // The head looks aside: space is turned back above the neck.
  Vec3d owl_space(Vec3d p) const {
    const double angle = -turn_ * smoothstep(-0.1, 0.6, p.y);
    const double c = portable::cos(angle), s = portable::sin(angle);
    return {c * p.x + s * p.z, p.y, c * p.z - s * p.x};
  }

  static double beak(Vec3d q) { return ellipsoid(q, {0, 0.47, 0.66}, {0.095, 0.20, 0.19}); }
  double wing(Vec3d q) const { return ellipsoid(q, {0.78 * girth_, -0.42, -0.10}, {0.20, 0.80, 0.52}); }
  static double foot(Vec3d q) {
    double d = 9;
    for (const double x : {-0.13, 0.0, 0.13})
      d = std::min(d, ellipsoid(q, {0.31 + x, -1.26, 0.60 - 0.6 * std::fabs(x)}, {0.075, 0.12, 0.16}));
    return d;
  }

  /// Below 0 inside of the owl.
  double form(Vec3d p) const {
    const Vec3d q{std::fabs(p.x), p.y, p.z};
    double d = ellipsoid(q, {0, -0.38, 0}, {0.86 * girth_, 1.0, 0.76 * girth_});
    d = joined(d, ellipsoid(q, {0, -0.86, -0.01}, {0.83 * girth_, 0.72, 0.74 * girth_}), 0.3);
    d = joined(d, ellipsoid(q, {0, 0.66, 0.05}, {0.80, 0.58, 0.64}), 0.22);
    const Vec3d leaning{q.x - 0.35 * (q.y - 1.0), q.y, q.z};
    d = joined(d, ellipsoid(leaning, {0.47, 1.12, 0.0}, {0.15, tufts_, 0.13}), 0.2);
    d = joined(d, ellipsoid(q, {0, -1.02, -0.62}, {0.34, 0.30, 0.28}), 0.15);
    d = joined(d, wing(q), 0.14);
    d = joined(d, ellipsoid(q, {0.33, 0.70, 0.54}, {0.33, 0.33, 0.13}), 0.05);
    d = joined(d, ellipsoid(q, {0.33, 0.70, 0.64}, {0.155, 0.155, 0.10}), 0.02);
    d = joined(d, beak(q), 0.05);
    d = joined(d, foot(q), 0.08);
    const double rim = disc_distance(q.x, q.z) - 0.70, top = std::fabs(q.y + 1.44) - 0.12;
    const double plinth =
        std::min(std::max(rim, top), 0.0) + disc_distance(std::max(rim, 0.0), std::max(top, 0.0)) - 0.03;
    return joined(d, plinth, 0.12);
  }

  /// `soft`: the width of an edge between two colours.
  Paint paint(Vec3d p, double soft) const {
    const Vec3d q{std::fabs(p.x), p.y, p.z};
    const double angle = portable::atan2(p.x, p.z);
    const auto edge = [soft](double inside) { return smoothstep(-soft, soft, inside); };
    Paint out = plumage(p, angle, edge);
    const auto cover = [&](double inside, Vec3d colour, double relief = 0) {
      const double t = edge(inside);
      out.colour = mix(out.colour, colour, t);
      out.relief = mix(out.relief, relief, smoothstep(-0.02, 0.02, inside));
      out.open = mix(out.open, 1, t);
    };
    constexpr double kWing = 0.075;  // what the relief leaves of it
    if (wing(q) < kWing) {
      const Feather f = feather_at(2.2 * q.z / 0.5 + 0.3, 4.2 * (1 - q.y) - 0.9 * q.z, 1e6, seed_ + 5);
      Vec3d colour = mix(glaze_[2], glaze_[2] * 1.7, 0.5 * f.tone);
      colour = mix(colour, glaze_[0], edge(0.10 - std::fabs(f.inside - 0.22)));
      colour = mix(colour, glaze_[3], edge(0.05 - std::fabs(f.across)) * edge(f.inside - 0.36));
      cover(kWing - wing(q), colour, 0.03 * smoothstep(0, 0.25, f.inside) + 0.02 * f.down);
      out.open = std::min(out.open, 0.45 + 0.55 * smoothstep(0, 0.12, f.inside));
    }
    if (p.z > 0.2 && p.y > 0.2) face(q, cover);
    cover(0.035 - foot(q), glaze_[3]);
    const double plinth = -1.295 - q.y;
    cover(plinth, glaze_[2]);
    if (plinth > 0) {
      const double across = (q.y + 1.44) / 0.10, wave = 14 * (angle / portable::kPi + 1);
      const double tooth = 2 * std::fabs(wave - std::floor(wave) - 0.5);
      cover(0.16 - std::fabs(across * 0.5 + 0.5 - tooth), glaze_[0]);
      cover(std::fabs(across) - 1.0, glaze_[1]);
    }
    return out;
  }

  /// Face: a ring of fine feathers around each eye, iris, pupil, the light in it; a beak.
  template <class Cover>
  void face(Vec3d q, const Cover& cover) const {
    const double x = q.x - 0.33, y = q.y - 0.70, r = disc_distance(x, y);
    const double spoke = portable::atan2(y, x) / (2 * portable::kPi);
    const auto teeth = [spoke](double n) { return std::fabs(n * spoke - std::floor(n * spoke) - 0.5) * 2; };
    cover(0.385 - r, glaze_[2]);
    cover(0.36 - r, glaze_[0] * 1.04);
    cover((0.36 - r) * 2.2 - 0.24 * teeth(30), glaze_[1]);
    cover(0.225 - r, glaze_[2]);
    cover(0.20 - r, mix(glaze_[3], Vec3d{0.98, 0.80, 0.30}, 0.6 * teeth(22)));
    cover(0.118 - r, kInk);
    cover(0.034 - disc_distance(x + 0.035, y - 0.045), {0.97, 0.97, 0.95});
    cover(0.02 - beak(q), glaze_[3] * 0.86);
  }

  /// Breast, back and crown.
  template <class Edge>
  Paint plumage(Vec3d p, double angle, const Edge& edge) const {
    Paint out;
    constexpr double kAround = 22;
    const Feather f =
        feather_at(kAround * (angle / (2 * portable::kPi) + 0.5), 6.2 * (1.1 - p.y), kAround, seed_ + 4);
    // Feathers would shrink to lines on the crown.
    const double crown =
        smoothstep(0.98, 1.06, p.y + 0.1 * (1 - smoothstep(0.1, 0.5, disc_distance(p.x, p.z))));
    const double front = smoothstep(-0.15, 0.25, p.z) * (1 - smoothstep(0.2, 0.5, p.y));
    const Vec3d ground = mix(glaze_[1] * 0.92, glaze_[0], front), mark = mix(glaze_[0], glaze_[1], front);
    out.colour = ground * (0.88 + 0.2 * f.tone);
    const double kept = 1 - crown;
    out.colour = mix(out.colour, mark, kept * edge(0.10 - std::fabs(f.inside - 0.24)));
    const double drop = disc_distance(f.across * 0.9, f.down - 0.30);
    out.colour = mix(out.colour, glaze_[2], kept * edge(0.17 - drop));
    out.colour = mix(out.colour, kInk, 0.55 * kept * (1 - smoothstep(0.02, 0.09, f.inside)));
    out.relief = kept * (0.028 * smoothstep(0, 0.3, f.inside) + 0.022 * f.down);
    out.open = mix(1, 0.5 + 0.5 * smoothstep(0, 0.14, f.inside), kept);
    const double stripes = 11 * p.y;
    out.colour =
        mix(out.colour, glaze_[2], crown * edge(0.25 - std::fabs(stripes - std::floor(stripes) - 0.5)));
    return out;
  }

  std::uint32_t seed_;
  double turn_, girth_, tufts_;
  std::array<Vec3d, 4> glaze_;
};

}  // namespace

std::unique_ptr<ScanShape> make_owl(std::uint32_t seed) { return std::make_unique<OwlShape>(seed); }

}  // namespace texmesh
