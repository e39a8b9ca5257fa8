#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "base/verdict.h"

namespace crosstie::base {

/// A characteristic of an acceptance test at one place, with what is known of it.
struct AcceptanceValue {
  double value_mm = 0.0;
  double noise_sigma_mm = 0.0;     ///< of the points, neighbours that err together counted
  double artefact_sigma_mm = 0.0;  ///< of the artefact: certificate, form, temperature

  [[nodiscard]] double sigma_mm() const { return std::hypot(noise_sigma_mm, artefact_sigma_mm); }
};

/// What a surface's points say of the range of their deviations from the least-squares shape.
struct FormFigures {
  std::size_t count = 0;                        ///< points that were taken for the artefact's surface
  std::size_t discarded = 0;                    ///< of them, the permitted share with the largest deviations
  std::size_t beyond_cap = 0;                   ///< left out: too near to the silhouette or the plate's border
  double rms_mm = 0.0;                          ///< standard deviation of the deviations, without the discarded ones: PF(sigma)
  double point_sigma_mm = 0.0;                  ///< rms of the points' own sigma along the normal; 0 where none is known
  double predicted_mm = 0.0;                    ///< the range that these sigmas alone would give; 0 where none is known
  double independent_share = 1.0;               ///< how many independent points one is worth: N_eff / N
  double correlation_mm = 0.0;                  ///< size of the places within which points err together; 0: they do not
  std::vector<double> deviations_mm = {};       ///< of the points that count, along the normal, positive outside
  std::vector<Eigen::Vector2d> places_mm = {};  ///< of the same, laid flat (equal area) about the middle of cap or plate
};

/// A sphere of the artefact as the scanner measured it.
struct MeasuredSphere {
  std::string name;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();  ///< of the centre, radius free
  double diameter_mm = 0.0;
  double diameter_sigma_mm = 0.0;
  Eigen::Vector3d held_centre_mm = Eigen::Vector3d::Zero();  ///< with the radius held at its calibrated value
  Eigen::Matrix3d held_cov_mm2 = Eigen::Matrix3d::Zero();
  double cap_rad = 0.0;       ///< full opening of the cap that the points cover, the narrowest way across
  double size_bias_mm = 0.0;  ///< by how much noise alone makes the least-squares diameter larger (second order); not taken off
  FormFigures form_figures;
  AcceptanceValue form;  ///< PF: range of the radial deviations
  AcceptanceValue size;  ///< PS: measured less calibrated diameter
};

/// Two spheres of a ball bar.
struct SphereSpacing {
  double measured_mm = 0.0;
  double calibrated_mm = 0.0;    ///< at the bar's temperature
  AcceptanceValue error;         ///< SD: measured less calibrated distance of the centres, radii free
  AcceptanceValue held_error;    ///< the same with the radii held at their calibrated values
  AcceptanceValue length_error;  ///< E: of the length over both spheres, SD and the mean of their PS
};

struct MeasuredPlane {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double length_mm = 0.0;  ///< largest extent of the points that count
  FormFigures form_figures;
  AcceptanceValue flatness;  ///< F: range of the deviations
};

/// One place of an artefact in the measuring volume.
struct AcceptancePosition {
  std::string name;
  std::string artefact;  ///< sphere, bar, plane
  std::vector<MeasuredSphere> spheres;
  std::optional<SphereSpacing> spacing;
  std::optional<MeasuredPlane> plane;
};

/// A characteristic over all positions: its worst value held against the limit.
struct AcceptanceCharacteristic {
  std::string name;   ///< PF, PS, SD, F, E
  std::string about;  ///< in words
  std::size_t positions = 0;
  std::size_t positions_asked = 0;  ///< by the guideline
  std::string worst;                ///< position (and sphere) of the largest |value|, sigma aside
  AcceptanceValue value;
  std::optional<double> limit_mm;          ///< maximum permissible error of |value|
  VerdictLevel level = VerdictLevel::kOk;  ///< the worst of all positions
};

/// An acceptance test of a scanner after VDI/VDE 2634 part 2 (single views) or part 3 (several views).
struct Acceptance {
  int part = 2;
  std::vector<AcceptancePosition> positions;
  std::vector<AcceptanceCharacteristic> characteristics;
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
