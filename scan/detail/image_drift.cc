#include "scan/detail/image_drift.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace crosstie::scan::detail {
namespace {

// Prior sigmas; what the residuals do not tell stays at 0 by them. Light that goes with the cosine of the shifts looks as movement does
// that goes with their sine, with 2 pi as much gain as turns: lamps keep their level from image to image to this.
constexpr double kPriorTurns = 0.1;
constexpr double kPriorGain = 0.005;
constexpr double kPriorOffset = 0.3;  // of the modulation

}  // namespace

ImageDrift::ImageDrift(const std::vector<double>& shifts)
    : steps_(static_cast<Eigen::Index>(shifts.size())),
      design_(steps_, 3),
      products_(Eigen::MatrixXd::Zero(3 * steps_, 3 * steps_)),
      right_(Eigen::VectorXd::Zero(3 * steps_)),
      change_(3 * steps_) {
  for (Eigen::Index n = 0; n < steps_; ++n) {
    const double angle = 2.0 * std::numbers::pi * shifts[static_cast<std::size_t>(n)];
    design_.row(n) << 1.0, std::cos(angle), std::sin(angle);
  }
}

void ImageDrift::add(double turns, double modulation, double mean, const std::vector<double>& residuals) {
  // Of each image: the level's change with e, g and o.
  const double c = modulation * std::cos(2.0 * std::numbers::pi * turns);
  const double s = modulation * std::sin(2.0 * std::numbers::pi * turns);
  const Eigen::Map<const Eigen::VectorXd> r(residuals.data(), steps_);
  for (Eigen::Index n = 0; n < steps_; ++n) {
    const double cosine = c * design_(n, 1) + s * design_(n, 2);  // B cos 2 pi (turns - shift)
    const double sine = s * design_(n, 1) - c * design_(n, 2);
    change_(n) = -2.0 * std::numbers::pi * sine;
    change_(steps_ + n) = mean + cosine;
    change_(2 * steps_ + n) = 1.0;
    for (Eigen::Index part = 0; part < 3; ++part) right_(part * steps_ + n) += change_(part * steps_ + n) * r(n);
  }
  products_.selfadjointView<Eigen::Lower>().rankUpdate(change_);
  squares_ += r.squaredNorm();
  modulation_ += modulation;
  ++pixels_;
}

ImageDrift::Estimate ImageDrift::estimate() const {
  constexpr int kLeastPixels = 100;
  if (pixels_ < kLeastPixels || steps_ < 4) return {};
  const double variance = squares_ / (static_cast<double>(pixels_) * static_cast<double>(steps_ - 3));
  Eigen::VectorXd prior(3 * steps_);
  prior.head(steps_).setConstant(1.0 / (kPriorTurns * kPriorTurns));
  prior.segment(steps_, steps_).setConstant(1.0 / (kPriorGain * kPriorGain));
  prior.tail(steps_).setConstant(1.0 / std::pow(kPriorOffset * modulation_ / pixels_, 2));
  // Residuals are what least squares leaves of the levels.
  const Eigen::MatrixXd rest =
      Eigen::MatrixXd::Identity(steps_, steps_) - design_ * (design_.transpose() * design_).inverse() * design_.transpose();
  Eigen::MatrixXd normal = products_.selfadjointView<Eigen::Lower>();
  normal.array() *= rest.replicate(3, 3).array();
  normal.diagonal() += variance * prior;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(normal);
  const Eigen::MatrixXd cofactor = ldlt.solve(Eigen::MatrixXd::Identity(3 * steps_, 3 * steps_));
  Estimate result;
  result.pixels = pixels_;
  // Less the mean, which nothing tells.
  const Eigen::MatrixXd centred =
      Eigen::MatrixXd::Identity(steps_, steps_) - Eigen::MatrixXd::Constant(steps_, steps_, 1.0 / static_cast<double>(steps_));
  result.turns = centred * (cofactor * right_).head(steps_);
  const Eigen::MatrixXd cov = variance * centred * cofactor.topLeftCorner(steps_, steps_) * centred.transpose();
  result.sigma_turns = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  return result;
}

}  // namespace crosstie::scan::detail
