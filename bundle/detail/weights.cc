#include "bundle/detail/weights.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "math/median.h"

namespace crosstie::bundle::detail {

/// What an image point tells of the sigmas.
struct Weights::Item {
  Eigen::Matrix2d detector;
  Eigen::Vector2d residual_px;
  double redundancy;
};

Weights::Weights(const Survey& survey, const AdjustOptions& options) {
  renew(survey);
  if (options.weights == ImageWeights::kEqual) {
    equal_sigma_px_ = options.sigma_px;
  } else if (options.model_sigma_px) {
    model_sigma_px_.fill(*options.model_sigma_px);
  } else {
    estimated_ = true;
  }
}

Eigen::Matrix2d Weights::covariance(const Eigen::Matrix2d& detector, Kind kind) const {
  if (equal_sigma_px_ > 0.0) return equal_sigma_px_ * equal_sigma_px_ * Eigen::Matrix2d::Identity();
  return detector + model_sigma_px_[kind] * model_sigma_px_[kind] * Eigen::Matrix2d::Identity();
}

Eigen::Matrix2d Weights::covariance(int ray) const {
  const auto r = static_cast<std::size_t>(ray);
  const double ratio = ratio_[static_cast<std::size_t>(cameras_[r])];
  return ratio * ratio * covariance(detector_[r], kinds_[r]);
}

void Weights::scale(int camera, double ratio) { ratio_[static_cast<std::size_t>(camera)] *= ratio; }

Eigen::Matrix2d Weights::of_detector(const Eigen::Matrix2d& cov_px2) const { return covariance(cov_px2, kUncoded); }

void Weights::renew(const Survey& survey) {
  detector_.clear();
  kinds_.clear();
  cameras_.clear();
  ratio_.resize(survey.cameras.size(), 1.0);
  for (const Ray& ray : survey.rays) {
    detector_.push_back(ray.cov_px2);
    cameras_.push_back(survey.camera_of_image[static_cast<std::size_t>(ray.image)]);
    kinds_.push_back(static_cast<std::size_t>(ray.point) < survey.coded_points ? kCoded : kUncoded);
  }
}

std::vector<Eigen::Matrix2d> Weights::whitening() const {
  std::vector<Eigen::Matrix2d> result;
  for (std::size_t r = 0; r < detector_.size(); ++r) {
    const Eigen::LLT<Eigen::Matrix2d> llt(covariance(static_cast<int>(r)));
    result.push_back(llt.matrixL().solve(Eigen::Matrix2d::Identity()));
  }
  return result;
}

void Weights::guess(double robust_sigma_px) {
  if (!estimated_) return;
  std::vector<double> variances;
  for (const Eigen::Matrix2d& cov : detector_) variances.push_back(0.5 * cov.trace());
  model_sigma_px_.fill(std::sqrt(std::max(0.0, robust_sigma_px * robust_sigma_px - math::median(variances))));
}

double Weights::component(const std::vector<Item>& items, bool robust) const {
  constexpr double kChiSquare2Median = 1.3862943611198906;  // 2 ln 2
  double redundancy = 0.0;
  for (const Item& item : items) redundancy += item.redundancy;
  const auto excess = [&](double variance) {  // positive where the sigmas are too small
    if (robust) {
      std::vector<double> squares;
      for (const Item& item : items) {
        if (item.redundancy < 0.2) continue;
        const Eigen::Matrix2d cov = item.detector + variance * Eigen::Matrix2d::Identity();
        squares.push_back(item.residual_px.dot(cov.inverse() * item.residual_px) * 2.0 / item.redundancy);
      }
      return math::median(std::move(squares)) - kChiSquare2Median;
    }
    double sum = 0.0;
    for (const Item& item : items) {
      const Eigen::Matrix2d cov = item.detector + variance * Eigen::Matrix2d::Identity();
      sum += item.residual_px.dot(cov.inverse() * item.residual_px);
    }
    return sum - redundancy;
  };
  if (!(excess(0.0) > 0.0)) return 0.0;
  double low = 0.0;
  double high = 1e-6;
  while (excess(high) > 0.0 && high < 1e6) high *= 4.0;
  for (int i = 0; i < 100 && high - low > 1e-14 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0.0 ? low : high) = middle;
  }
  return std::sqrt(0.5 * (low + high));
}

double Weights::update(const Survey& survey, const Estimate& at, bool robust) {
  if (!estimated_) return 0.0;
  std::array<std::vector<Item>, kKinds> items;
  std::array<std::vector<char>, kKinds> active;
  active.fill(std::vector<char>(survey.rays.size(), 0));
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int ray = at.network.ray_of_group[static_cast<std::size_t>(g)];
    if (ray < 0) continue;
    const auto r = static_cast<std::size_t>(ray);
    const Eigen::LLT<Eigen::Matrix2d> llt(covariance(ray));
    const Eigen::Vector2d residual = llt.matrixL() * at.rows.residual(g);
    const double number = at.residual_cofactors()[static_cast<std::size_t>(g)].trace();
    items[kinds_[r]].push_back({detector_[r], residual, number});
    active[kinds_[r]][r] = 1;
  }
  double change = 0.0;
  for (const Kind kind : {kCoded, kUncoded}) {
    if (items[kind].empty()) continue;
    const double before = unit_sigma_px(active[kind]);
    model_sigma_px_[kind] = component(items[kind], robust);
    change = std::max(change, std::abs(unit_sigma_px(active[kind]) / before - 1.0));
  }
  return change;
}

double Weights::unit_sigma_px(const std::vector<char>& active) const {
  std::vector<double> sigmas;
  for (std::size_t r = 0; r < detector_.size(); ++r) {
    if (active[r]) sigmas.push_back(std::sqrt(0.5 * covariance(static_cast<int>(r)).trace()));
  }
  return math::median(std::move(sigmas));
}

}  // namespace crosstie::bundle::detail
