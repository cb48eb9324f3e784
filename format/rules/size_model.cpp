#include "format/rules/size_model.h"

#include <algorithm>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

/// log R = B log(100 p), by (8.8).
double log_r(const SizeModel& model, double vqp) {
  return static_cast<double>(model.b) * portable::log(100 * std::max(vqp, kLeastModelVqp));
}

bool has_model(const SizeModel& model) { return model.a > 0 && model.b > 0; }

}  // namespace

double modelled_bytes(const SizeModel& model, double vqp, double quality) {
  if (!has_model(model)) return 0;
  return static_cast<double>(model.a) * portable::exp(quality * log_r(model, vqp));
}

double modelled_quality(const SizeModel& model, double vqp, double bytes) {
  if (!has_model(model) || !(bytes > 0)) return 0;
  return (portable::log(bytes) - portable::log(static_cast<double>(model.a))) / log_r(model, vqp);
}

}  // namespace texmesh
