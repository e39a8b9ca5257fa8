#include "calib/detail/state.h"

namespace crosstie::calib::detail {

bool is_joint(const State& state, const Station& station) {
  return state.left_from_right && station.paired() && state.takes_part(station.view[0]) && state.takes_part(station.view[1]);
}

PoseData pose_data(const Problem& problem, const State& state, int view) {
  std::vector<int> used;
  for (const int c : problem.views[static_cast<std::size_t>(view)].corners) {
    if (state.active[static_cast<std::size_t>(c)]) used.push_back(c);
  }
  const auto count = static_cast<Eigen::Index>(used.size());
  PoseData data{Eigen::Matrix3Xd(3, count), Eigen::Matrix2Xd(2, count), Eigen::VectorXd(count)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const Corner& corner = problem.corners[static_cast<std::size_t>(used[static_cast<std::size_t>(i)])];
    data.points.col(i) = state.points.col(corner.point);
    data.pixels.col(i) = corner.px;
    data.sigma_px(i) = state.sigma_px * corner.relative_sigma;
  }
  return data;
}

}  // namespace crosstie::calib::detail
