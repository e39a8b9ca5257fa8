#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/edge_curve.h"
#include "edge/hole_edge.h"
#include "fixtures/scene.h"

namespace crosstie::tests {

/// What is drawn beside the exact rim.
struct DoorNoise {
  double edge_px = 0.05;   ///< of an edge pixel across the edge, correlated over the piece of edge that it stands for
  double depth_mm = 0.10;  ///< of a depth along its ray
  bool far_rim = false;    ///< where the cut meets the inner surface of the wall, as far as the hole lets it be seen
  bool shadows = false;    ///< edges of shadows on the face, all round the hole
  bool paint = false;
  bool ledge = false;  ///< a plate on the face beside the hole
};

/// How a measured rim differs from the true one.
struct RimStatistics {
  int count = 0;
  double mean_u_mm = 0.0, rms_u_mm = 0.0, normalised_u = 0.0;  ///< across the rim in the face; mean of (error / sigma)^2
  double mean_v_mm = 0.0, rms_v_mm = 0.0, normalised_v = 0.0;  ///< along the normal
  double normalised_tilt = 0.0;                                ///< of the normals, both ways
  double farthest_mm = 0.0;
  double most_turn_rad = 0.0;  ///< of a normal from the true one
  double covered = 0.0;        ///< share of the rim that no gap leaves out

  void add(const RimStatistics& other);
};

/// What one stop of the head sees of the door, in the wall's frame `part`.
struct DoorStation {
  std::string name;
  base::Pose part_from_rig;
  std::array<base::EdgePixels, 2> edges;
  std::vector<float> depth_mm, sigma_mm;
};

/// The twin's door at half its image size: the rim by fixtures::rim_point, depths where rays meet the cone, both exact but for the noise.
class Door {
 public:
  Door();
  [[nodiscard]] std::vector<DoorStation> stations(const DoorNoise& noise, std::uint64_t seed) const;
  [[nodiscard]] std::vector<edge::StationView> views(const std::vector<DoorStation>& stations) const;
  [[nodiscard]] fixtures::RimPoint rim(double turn) const;
  [[nodiscard]] RimStatistics compare(const base::EdgeCurve& curve) const;

 private:
  fixtures::Scene scene_;
  base::Head head_;
};

/// The same for any wall with a hole; the curve in the wall's frame.
[[nodiscard]] RimStatistics compare_rim(const base::EdgeCurve& curve, const fixtures::Wall& wall);

}  // namespace crosstie::tests
