#include "bundle/detail/summary.h"

#include <cmath>
#include <limits>
#include <vector>

#include "base/image_coverage.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

int first_distortion(base::LensModel model) { return model == base::LensModel::kAicon ? 3 : 4; }

}  // namespace

void count_observations(const Estimate& at, base::AdjustedNetwork& result) {
  base::ObservationCounts counts;
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const auto k = static_cast<std::size_t>(g);
    int& kind = at.network.ray_of_group[k] >= 0       ? counts.image_coordinates
                : at.network.bar_of_group[k] >= 0     ? counts.scale_bars
                : at.network.control_of_group[k] >= 0 ? counts.control_coordinates
                                                      : counts.lens_parameters;
    kind += at.rows.group(g).rows;
  }
  result.observed = counts;
}

void count_unknowns(const Estimate& at, base::AdjustedNetwork& result) {
  base::UnknownCounts counts;
  for (const math::Block& block : at.network.model.blocks) {
    int& kind = block.kind == math::Block::Kind::kPoint   ? counts.object
                : block.kind == math::Block::Kind::kPose  ? counts.exterior
                : block.kind == math::Block::Kind::kMount ? counts.rig
                                                          : counts.interior;
    kind += static_cast<int>(block.free.size());
  }
  result.estimated = counts;
}

void add_coverage(base::AdjustedNetwork& result) {
  std::vector<std::vector<Eigen::Vector2d>> points(result.images.size());
  for (const auto& one : result.residuals) points[static_cast<std::size_t>(one.image)].push_back(one.measured_px);
  for (base::AdjustedCamera& camera : result.cameras) {
    const Eigen::Vector2d size(camera.camera.width_px(), camera.camera.height_px());
    std::vector<Eigen::Vector2d> all;
    for (std::size_t i = 0; i < result.images.size(); ++i) {
      if (result.images[i].camera != camera.name || points[i].empty()) continue;
      all.insert(all.end(), points[i].begin(), points[i].end());
      Eigen::Vector2d low = points[i].front();
      Eigen::Vector2d high = low;
      for (const Eigen::Vector2d& point : points[i]) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
      }
      result.images[i].coverage = (high - low).cwiseQuotient(size).prod();
    }
    camera.coverage = base::covered_share(base::ImageCells(camera.camera.width_px(), camera.camera.height_px()), all);
  }
}

void add_significance(const Estimate& at, base::AdjustedNetwork& result) {
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    base::AdjustedCamera& camera = result.cameras[c];
    const int block = at.network.camera_block[c];
    const Eigen::MatrixXd& cov = camera.camera.covariance();
    if (!camera.estimated || block < 0 || cov.size() == 0 || at.redundancy < 1) continue;
    const int first = first_distortion(camera.camera.model());
    camera.significance_p = Eigen::VectorXd::Constant(cov.rows(), std::numeric_limits<double>::quiet_NaN());
    for (const int i : at.network.model.blocks[static_cast<std::size_t>(block)].free) {
      if (i < first || !(cov(i, i) > 0.0)) continue;
      const double t = camera.camera.parameters()(i) / std::sqrt(cov(i, i));
      camera.significance_p(i) = math::student_two_sided(t, at.redundancy);
    }
  }
}

}  // namespace crosstie::bundle::detail
