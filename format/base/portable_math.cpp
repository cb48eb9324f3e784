#include "format/base/portable_math.h"

#include <cmath>
#include <limits>

namespace texmesh::portable {
namespace {

constexpr double kLn2Hi = 6.93147180369123816490e-01, kLn2Lo = 1.90821492927058770002e-10;
constexpr double kPio2Hi = 1.57079632673412561417e+00, kPio2Lo = 6.07710050650619224932e-11;

// Taylor coefficients suffice on the reduced ranges and are easy to trust; minimax would save three terms.
double sin_reduced(double r) {
  const double z = r * r;
  double s = 0;
  for (int k = 17; k >= 3; k -= 2) s = (1.0 + s) * (-z / (k * (k - 1.0)));
  return r * (1.0 + s);
}
double cos_reduced(double r) {
  const double z = r * r;
  double s = 0;
  for (int k = 18; k >= 2; k -= 2) s = (1.0 + s) * (-z / (k * (k - 1.0)));
  return 1.0 + s;
}
double sin_quadrant(double x, int add) {
  const double q = std::nearbyint(x / (kPi / 2));
  const double r = (x - q * kPio2Hi) - q * kPio2Lo;
  switch ((static_cast<long long>(q) + add) & 3) {
    case 0:
      return sin_reduced(r);
    case 1:
      return cos_reduced(r);
    case 2:
      return -sin_reduced(r);
    default:
      return -cos_reduced(r);
  }
}
double atan_positive(double t) {  // 0 <= t <= 1
  // Two halvings bring t under 0.2, where fourteen terms reach the last bits.
  int halvings = 0;
  for (; halvings < 2; ++halvings) t = t / (1.0 + std::sqrt(1.0 + t * t));
  const double z = t * t;
  double s = 0;
  for (int k = 27; k >= 1; k -= 2) s = 1.0 / k - z * s;
  return 4.0 * t * s;
}

}  // namespace

double exp(double x) {
  if (std::isnan(x)) return x;
  if (x > 709.78) return std::numeric_limits<double>::infinity();
  if (x < -745.2) return 0;
  const double q = std::nearbyint(x / (kLn2Hi + kLn2Lo));
  const double r = (x - q * kLn2Hi) - q * kLn2Lo;
  double s = 1.0;
  for (int k = 14; k >= 1; --k) s = 1.0 + s * (r / k);
  return std::ldexp(s, static_cast<int>(q));
}

double log(double x) {
  if (!(x > 0))
    return x == 0 ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
  if (std::isinf(x)) return x;
  int e = 0;
  double m = std::frexp(x, &e);  // m in [0.5, 1)
  if (m < 0.70710678118654752440) {
    m *= 2;
    --e;
  }
  const double f = (m - 1) / (m + 1), z = f * f;
  double s = 0;
  for (int k = 23; k >= 1; k -= 2) s = 1.0 / k + z * s;
  return e * kLn2Hi + (2 * f * s + e * kLn2Lo);
}

double sin(double x) { return sin_quadrant(x, 0); }
double cos(double x) { return sin_quadrant(x, 1); }

double atan2(double y, double x) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  if (ax == 0 && ay == 0) return 0;
  double a = ay <= ax ? atan_positive(ay / ax) : kPi / 2 - atan_positive(ax / ay);
  if (x < 0) a = kPi - a;
  return y < 0 ? -a : a;
}

double pow(double base, double exponent) { return exp(exponent * log(base)); }

}  // namespace texmesh::portable
