#pragma once

#include <string>
#include <vector>

#include "app/scene_survey.h"
#include "fixtures/scene.h"

namespace crosstie::app {

/// A scene surveyed in another way.
struct SceneVariant {
  std::string what;   ///< "stations"
  std::string value;  ///< "3"
  fixtures::Scene scene;
  SurveyOptions options;
  bool other_board = false;  ///< the calibration of the head is another one
};

/// One thing at a time is changed: of a machine the number of stations over the same travel (3 to 9), of balls (three up to those that the
/// cross has, and more of them half-way along its arms), of markers on the cross, of board poses; the noise of markers and corners; of a
/// network the number of photographs, of markers and of bars.
[[nodiscard]] std::vector<SceneVariant> scene_variants(const fixtures::Scene& scene, const SurveyOptions& options);

/// The scene with so many stations, evenly spaced between its first and its last.
[[nodiscard]] fixtures::Scene with_stations(fixtures::Scene scene, int count);

}  // namespace crosstie::app
