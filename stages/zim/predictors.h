#pragma once
// Inside stages: what VQP (8.4) may be made of. A predictor is a name and a function of one fragment's
// covered texels; the weights, by name, are options of the zim stage.
#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// One covered fragment as a predictor sees it.
struct PredictorInput {
  const TexturePlane& plane;
  const Pixels& pixels;
  std::size_t fragment = 0;
  double z = 0, i = 0, zeta = 0, m = 0;  // (8.1)-(8.3) of this fragment

  std::uint32_t left() const {
    return static_cast<std::uint32_t>(fragment % plane.columns) * plane.fragment_width_px;
  }
  std::uint32_t top() const {
    return static_cast<std::uint32_t>(fragment / plane.columns) * plane.fragment_height_px;
  }
  std::uint32_t right() const { return std::min(plane.width_px, left() + plane.fragment_width_px); }
  std::uint32_t bottom() const { return std::min(plane.height_px, top() + plane.fragment_height_px); }
  bool covered(std::uint32_t x, std::uint32_t y) const {
    return plane.coverage[y * ((std::size_t{plane.width_px} + 7) / 8) + x / 8] >> (7 - x % 8) & 1;
  }
};

/// Any finite number; what counts is where it stands between the least and largest of the plane's covered
/// fragments. Called from several threads.
using PredictorFunction = std::function<double(const PredictorInput&)>;

struct Predictor {
  std::string name, help;
  PredictorFunction value;
};

class PredictorRegistry {
 public:
  /// eta, z, i, m, zeta, area, surface, gradient: see predictors.cpp.
  static PredictorRegistry standard();
  /// StageError for a name that is taken or is not made of a-z, 0-9 and _.
  void add(Predictor predictor);
  const Predictor* find(std::string_view name) const;  // nullptr when there is none
  const std::vector<Predictor>& all() const { return predictors_; }
  std::string names() const;  // "eta, z, ..."

 private:
  std::vector<Predictor> predictors_;
};

struct WeightedPredictor {
  const Predictor* predictor = nullptr;
  double weight = 0;  // of all weights' sum
};
/// Reads "eta=1,z=1,area=0.5": names of the registry, each once, weights 0 to 100 of which one is above 0;
/// returns those above 0. Throws StageError that says what the registry has.
std::vector<WeightedPredictor> parse_weights(const PredictorRegistry& registry, std::string_view text);

}  // namespace texmesh
