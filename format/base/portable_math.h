#pragma once

namespace texmesh {

// exp, log, sin, cos, atan2, pow with the same bits on every x86-64 machine: libm picks fused-multiply-add
// variants at run time, whose last bits differ. Plain double arithmetic only; about 1e-15 relative. What
// reaches a package or a cache goes through these (std::sqrt is correctly rounded and fine as it is).
namespace portable {
double exp(double x);
double log(double x);  // x > 0
double sin(double x);  // |x| <= 1e6
double cos(double x);  // |x| <= 1e6
double atan2(double y, double x);
double pow(double base, double exponent);  // base > 0
inline constexpr double kPi = 3.14159265358979323846, kLn2 = 0.693147180559945309417;
}  // namespace portable

}  // namespace texmesh
