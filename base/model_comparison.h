#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/camera.h"
#include "base/projection_map.h"

namespace crosstie::base {

/// A camera model as it was given.
struct NamedModel {
  std::string name;  ///< of its file
  Camera camera;
};

/// Two models of one camera held against each other.
struct ModelComparison {
  NamedModel a;
  NamedModel b;
  ProjectionDifference difference;
};

/// The body of `compare`.
nlohmann::ordered_json model_comparison_json(const ModelComparison& comparison);

}  // namespace crosstie::base
