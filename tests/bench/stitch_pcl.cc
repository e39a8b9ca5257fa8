#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>

#include "tests/bench/stitch_peers.h"

namespace crosstie::bench {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

Cloud::Ptr cloud_of(const Points& points, const Eigen::Vector3d& origin) {
  Cloud::Ptr cloud(new Cloud);
  cloud->reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3f p = (point - origin).cast<float>();  // PCL is float: about the first cloud's middle
    cloud->push_back({p.x(), p.y(), p.z()});
  }
  return cloud;
}

}  // namespace

PeerAlignment pcl_gicp(const Points& first, const Points& second, const Eigen::Matrix4d& start, double reach_mm) {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : first) origin += point / static_cast<double>(first.size());
  Eigen::Matrix4d to = Eigen::Matrix4d::Identity();
  to.topRightCorner<3, 1>() = -origin;
  Eigen::Matrix4d from = to;
  from.topRightCorner<3, 1>() = origin;
  // The second cloud is brought to the first one's place beforehand, so that floats suffice.
  Points moved;
  moved.reserve(second.size());
  for (const Eigen::Vector3d& point : second) moved.push_back((start * point.homogeneous()).head<3>());
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setInputSource(cloud_of(moved, origin));
  gicp.setInputTarget(cloud_of(first, origin));
  gicp.setMaxCorrespondenceDistance(reach_mm);
  gicp.setRotationGradientTolerance(1e-4);
  gicp.setTranslationGradientTolerance(1e-4);
  gicp.setTransformationEpsilon(1e-6);
  Cloud aligned;
  gicp.align(aligned);
  return {from * gicp.getFinalTransformation().cast<double>() * to * start, gicp.hasConverged()};
}

}  // namespace crosstie::bench
