#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/Registration.h>
#include <open3d/pipelines/registration/TransformationEstimation.h>

#include "tests/bench/stitch_peers.h"

namespace crosstie::bench {

PeerAlignment open3d_point_to_plane(const Points& first, const Points& second, const Eigen::Matrix4d& start, double reach_mm) {
  namespace registration = open3d::pipelines::registration;
  open3d::geometry::PointCloud target(first);
  const open3d::geometry::PointCloud source(second);
  target.EstimateNormals(open3d::geometry::KDTreeSearchParamKNN(20));
  const auto result =
      registration::RegistrationICP(source, target, reach_mm, start, registration::TransformationEstimationPointToPlane());
  return {result.transformation_, result.fitness_ > 0.0};
}

}  // namespace crosstie::bench
