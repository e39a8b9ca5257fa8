#include "calib/detail/hold_out.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/QR>

#include "calib/detail/outcome.h"
#include "calib/detail/pose_fit.h"
#include "math/cofactors.h"

namespace crosstie::calib::detail {
namespace {

using base::fail;
using base::Result;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kLeastViews = 3;

bool takes_part(const State& state, const Station& station) {
  return std::any_of(station.view.begin(), station.view.end(), [&](int v) { return v >= 0 && state.takes_part(v); });
}

/// Whether every camera that has views keeps enough of them.
bool enough(const Problem& problem, const State& state, const Fold& fold) {
  std::array<int, 2> left{};
  for (std::size_t s = 0; s < problem.stations.size(); ++s) {
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      const int v = problem.stations[s].view[c];
      if (fold.used[s] && v >= 0 && state.takes_part(v)) ++left[c];
    }
  }
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    if (left[c] < kLeastViews) return false;
  }
  return true;
}

/// Fold k holds out every station whose turn it is; `keep_turn`: it holds out all the others.
std::vector<Fold> by_turns(const Problem& problem, const State& state, int count, bool keep_turn) {
  std::vector<Fold> folds(static_cast<std::size_t>(count));
  int turn = 0;
  for (Fold& fold : folds) fold.used.assign(problem.stations.size(), 0);
  for (std::size_t s = 0; s < problem.stations.size(); ++s) {
    if (!takes_part(state, problem.stations[s])) continue;
    for (int k = 0; k < count; ++k) folds[static_cast<std::size_t>(k)].used[s] = (turn % count == k) == keep_turn ? 1 : 0;
    ++turn;
  }
  if (!std::all_of(folds.begin(), folds.end(), [&](const Fold& fold) { return enough(problem, state, fold); })) return {};
  return folds;
}

/// The derivatives by every whitened row of all unknowns in `gradient`'s columns: rows x columns, corners and priors apart. With
/// errors of the rows of unit variance, the estimates of the columns' functions have these rows as their influence, J Q g.
struct Influence {
  MatrixXd corners;  ///< its square only: sum over the corners' rows
  MatrixXd priors;   ///< in the order of the priors, which is that of the board
};

Influence influence_of(const Estimate& at, const MatrixXd& gradient) {
  const math::WhitenedRows& rows = at.solution.rows;
  const math::Parameters& parameters = at.solution.equations.parameters();
  const MatrixXd z = at.solution.equations.solve(gradient);
  Influence result{MatrixXd::Zero(gradient.cols(), gradient.cols()), {}};
  std::vector<MatrixXd> priors;
  Eigen::Index prior_rows = 0;
  for (int g = 0; g < rows.group_count(); ++g) {
    MatrixXd moved = MatrixXd::Zero(rows.group(g).rows, gradient.cols());
    const auto terms = rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      moved.noalias() += rows.jacobian(g, t) * z.middleRows(parameters.block(terms[t].block).offset, terms[t].size);
    }
    if (at.network.corner_of_measurement[static_cast<std::size_t>(g)] >= 0) {
      result.corners.noalias() += moved.transpose() * moved;
    } else {
      prior_rows += moved.rows();
      priors.push_back(std::move(moved));
    }
  }
  result.priors.resize(prior_rows, gradient.cols());
  Eigen::Index row = 0;
  for (const MatrixXd& part : priors) {
    result.priors.middleRows(row, part.rows()) = part;
    row += part.rows();
  }
  return result;
}

/// Baseline (if there is a rig), then the lens parameters of each camera, as directions of the full vector of unknowns.
MatrixXd directions(const HeldOut& half) {
  const math::Parameters& parameters = half.estimate.solution.equations.parameters();
  const auto& network = half.estimate.network;
  Eigen::Index columns = network.mount_block >= 0 ? 1 : 0;
  for (const int b : network.camera_block) columns += parameters.block(b).size();
  MatrixXd gradient = MatrixXd::Zero(parameters.size(), columns);
  Eigen::Index column = 0;
  if (network.mount_block >= 0) {
    gradient.col(column++).segment<3>(parameters.block(network.mount_block).offset + 3) =
        half.state.left_from_right->translation_mm.normalized();
  }
  for (const int b : network.camera_block) {
    for (int i = 0; i < parameters.block(b).size(); ++i) gradient(parameters.block(b).offset + i, column++) = 1.0;
  }
  return gradient;
}

/// Of even minus odd: their corners are independent, their board is the same.
MatrixXd covariance_of_difference(const HeldOut& odd, const HeldOut& even) {
  const Influence a = influence_of(odd.estimate, directions(odd));
  const Influence b = influence_of(even.estimate, directions(even));
  MatrixXd cov = a.corners + b.corners;
  if (a.priors.rows() == b.priors.rows() && a.priors.rows() > 0) {
    const MatrixXd common = b.priors - a.priors;
    cov += common.transpose() * common;
  }
  return cov;
}

struct Difference {
  double px = 0.0;
  double predicted_px = 0.0;
};

/// Between two lenses over the middle of the image, after the motion of the camera that hides most of it.
std::optional<Difference> lens_difference(base::LensModel model, const VectorXd& odd, const VectorXd& even, const MatrixXd& cov,
                                          const Eigen::Vector2i& size_px, const std::array<double, 2>& distances_mm) {
  constexpr int kAcross = 16;
  constexpr double kRadius = 0.4;  // of the image's height
  const auto camera = base::Camera::make(model, size_px.x(), size_px.y(), odd);
  if (!camera) return {};
  const Eigen::Vector2d middle = 0.5 * (size_px.cast<double>() - Eigen::Vector2d::Ones());
  const double radius = kRadius * size_px.y();
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  for (int i = -kAcross / 2; i <= kAcross / 2; ++i) {
    for (int j = -kAcross / 2; j <= kAcross / 2; ++j) {
      const Eigen::Vector2d offset = 2.0 * radius / kAcross * Eigen::Vector2d(i, j);
      if (offset.norm() > radius) continue;
      const auto ray = camera->unproject(middle + offset);
      if (!ray) return {};
      for (const double distance : distances_mm) {
        points.push_back(*ray * distance);
        pixels.push_back(middle + offset);
      }
    }
  }
  const auto count = static_cast<Eigen::Index>(points.size());
  PoseData data{Eigen::Matrix3Xd(3, count), Eigen::Matrix2Xd(2, count), VectorXd::Ones(count)};
  for (Eigen::Index i = 0; i < count; ++i) {
    data.points.col(i) = points[static_cast<std::size_t>(i)];
    data.pixels.col(i) = pixels[static_cast<std::size_t>(i)];
  }
  const auto fit = fit_pose(model, even, data, {});
  if (!fit) return {};
  const Eigen::Index free = cov.rows();
  MatrixXd by_lens(2 * count, free);
  MatrixXd by_motion(2 * count, 6);
  const int all = base::parameter_count(model);
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> d_lens(2, all);
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
  for (Eigen::Index i = 0; i < count; ++i) {
    Eigen::Vector2d pixel;
    if (!base::project_bare(model, odd.data(), data.points.col(i).data(), pixel.data(), d_point.data(), d_lens.data()))
      return {};
    by_lens.middleRows<2>(2 * i) = d_lens.leftCols(free);
    by_motion.middleRows<2>(2 * i) << -d_point * base::skew(data.points.col(i)), d_point;
  }
  const MatrixXd left = by_lens - by_motion * by_motion.colPivHouseholderQr().solve(by_lens);
  const double square = (left * cov).cwiseProduct(left).sum();
  return Difference{std::sqrt(fit->square_px2 / static_cast<double>(count)),
                    std::sqrt(std::max(0.0, square) / static_cast<double>(count))};
}

/// Near and far end of where a camera saw the board.
std::array<double, 2> distances_mm(const Problem& problem, const HeldOut& a, const HeldOut& b, int camera) {
  std::vector<double> all;
  for (const HeldOut* half : {&a, &b}) {
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      const auto& pose = half->state.board_from_camera[v];
      if (problem.views[v].camera == camera && pose) all.push_back(pose->translation_mm.norm());
    }
  }
  std::sort(all.begin(), all.end());
  const auto at = [&](double share) { return all[static_cast<std::size_t>(share * static_cast<double>(all.size() - 1))]; };
  return {at(0.05), at(0.95)};
}

}  // namespace

std::vector<Fold> halves_of(const Problem& problem, const State& state) {
  std::vector<Fold> halves = by_turns(problem, state, 2, true);
  if (halves.empty()) return halves;
  halves[0].name = "odd";
  halves[1].name = "even";
  return halves;
}

std::vector<Fold> folds_of(const Problem& problem, const State& state, int count) {
  const auto stations = std::count_if(problem.stations.begin(), problem.stations.end(),
                                      [&](const Station& station) { return takes_part(state, station); });
  count = std::min(count, static_cast<int>(stations));
  if (count < 2) return {};
  std::vector<Fold> folds = by_turns(problem, state, count, false);
  for (std::size_t k = 0; k < folds.size(); ++k) folds[k].name = fmt::format("{} of {}", k + 1, folds.size());
  return folds;
}

Result<HeldOut> hold_out(const Problem& problem, const State& all, const Fold& fold, const base::Progress& progress) {
  State state = all;
  auto at = estimate(problem, state, {.stations = fold.used}, 1e-6, progress);
  if (!at) return fail(std::move(at));
  HeldOut result{std::move(state), std::move(*at), std::vector<double>(problem.views.size(), -1.0), {}};
  base::HeldOutFold& summary = result.summary;
  summary.name = fold.name;
  summary.stations = static_cast<int>(std::count(fold.used.begin(), fold.used.end(), 1));
  std::vector<double> sums(problem.cameras.size(), 0.0);
  std::vector<Eigen::Index> counts(problem.cameras.size(), 0);
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const View& view = problem.views[v];
    if (fold.used[static_cast<std::size_t>(view.station)] || !all.takes_part(static_cast<int>(v))) continue;
    const auto c = static_cast<std::size_t>(view.camera);
    const PoseData data = pose_data(problem, result.state, static_cast<int>(v));
    const auto fit = fit_pose(all.lens_model, result.state.lenses[c], data, *all.board_from_camera[v]);
    if (!fit) {
      return fail(base::ErrorCode::kNoUniqueSolution, "image " + view.image + " cannot be predicted from the others");
    }
    result.square_px2[v] = fit->square_px2;
    result.state.board_from_camera[v] = fit->board_from_camera;
    sums[c] += fit->square_px2;
    counts[c] += data.count();
  }
  for (std::size_t c = 0; c < sums.size(); ++c) {
    summary.rms_px.push_back(counts[c] > 0 ? std::sqrt(sums[c] / static_cast<double>(counts[c])) : 0.0);
  }
  if (result.estimate.network.mount_block >= 0) {
    const auto cofactors =
        math::Cofactors::make(result.estimate.solution.equations, result.estimate.solution.equations.null_space());
    if (!cofactors) return tl::unexpected(cofactors.error());
    const int mount = result.estimate.network.mount_block;
    const Baseline baseline = baseline_of(*result.state.left_from_right, cofactors->block(mount, mount));
    summary.baseline_mm = baseline.mm;
    summary.baseline_sigma_mm = baseline.sigma_mm;
  }
  return result;
}

double heldout_rms_px(const Problem& problem, const State& all, const std::vector<HeldOut>& folds, int camera) {
  double sum = 0.0;
  Eigen::Index count = 0;
  for (const HeldOut& fold : folds) {
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      const View& view = problem.views[v];
      if (fold.square_px2[v] < 0.0 || (camera >= 0 && view.camera != camera)) continue;
      sum += fold.square_px2[v];
      count += std::count_if(view.corners.begin(), view.corners.end(),
                             [&](int c) { return all.active[static_cast<std::size_t>(c)] != 0; });
    }
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

void compare_halves(const Problem& problem, const HeldOut& odd, const HeldOut& even, base::CrossValidation& result) {
  const MatrixXd cov = covariance_of_difference(odd, even);
  Eigen::Index at = 0;
  if (odd.estimate.network.mount_block >= 0 && even.estimate.network.mount_block >= 0) {
    result.baseline_gap_mm = even.summary.baseline_mm - odd.summary.baseline_mm;
    result.baseline_gap_sigma_mm = std::sqrt(std::max(0.0, cov(0, 0)));
    at = 1;
  }
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    const Eigen::Index size = base::adjustable_count(odd.state.lens_model);
    const auto difference =
        lens_difference(odd.state.lens_model, odd.state.lenses[c], even.state.lenses[c], cov.block(at, at, size, size),
                        problem.size_px[c], distances_mm(problem, odd, even, static_cast<int>(c)));
    at += size;
    result.model_difference_px.push_back(difference ? difference->px : 0.0);
    result.model_difference_predicted_px.push_back(difference ? difference->predicted_px : 0.0);
  }
}

}  // namespace crosstie::calib::detail
