#include "bundle/check_head.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "base/commissioning_layout.h"
#include "bundle/detail/eccentricity.h"
#include "bundle/detail/linear_estimate.h"
#include "bundle/detail/rig_check.h"
#include "math/circle_of_pair.h"
#include "math/distributions.h"

namespace crosstie::bundle {
namespace {

using base::ErrorCode;
using base::fail;
using base::HeadCheck;
using base::Matrix6d;
using base::Pose;
using base::Result;
using base::Vector6d;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kLeastMarkers = 6;
constexpr int kMaxSteps = 12;
constexpr double kRayLevel = 1e-5;  // of an image point that no chance explains
using detail::kUnseen_mm;
using detail::kUnseen_rad;
using detail::linear_estimate;
using detail::LinearEstimate;
using detail::statistic;

constexpr const char* kRigNames[] = {"relative pitch", "yaw", "roll", "baseline x", "baseline y", "baseline z"};

/// A ray of this pair to a marker of the cross.
struct Ray {
  int camera = 0;
  Index marker = 0;  ///< index into Commissioning::markers
  Vector2d px;
  Eigen::Matrix2d cov;
  Eigen::Matrix2d shape_px2;  ///< see detail::shape_of
};

/// The pair, linearised: residual = seen - predicted = by_rig * rig change + by_head * head change + noise of covariance `cov`.
struct Linear {
  VectorXd residual;
  MatrixXd by_rig;
  MatrixXd by_head;
  MatrixXd cov;
};

HeadCheck::Test chi_square_test(std::string name, double value, int dof, double level) {
  HeadCheck::Test test{.name = std::move(name), .unit = "", .statistic = value, .dof = dof};
  test.value = std::sqrt(value / std::max(dof, 1));
  test.p = 1.0 - math::chi_square_cdf(value, dof);
  test.accused = test.p < level;
  return test;
}

class Check {
 public:
  Check(const CheckInput& input, const CheckOptions& options, const base::CommissioningLayout& layout)
      : input_(input), options_(options), known_(*input.commissioning), at_(layout) {}

  Result<HeadCheck> run();

 private:
  void collect(const base::ImageObservations& image, int camera);
  void reduce_centres();
  Result<> against_cross();
  void conclude();
  [[nodiscard]] bool linearise(const Pose& machine_from_rig, const Pose& right_from_left, Linear& linear) const;
  void second_reference();
  [[nodiscard]] std::vector<detail::CommonMarker> common() const;
  Result<> epipolar_only();
  /// Of both lenses and the rig.
  [[nodiscard]] MatrixXd head_cov() const { return known_.covariance.topLeftCorner(at_.frame, at_.frame); }

  const CheckInput& input_;
  const CheckOptions& options_;
  const base::Commissioning& known_;
  const base::CommissioningLayout at_;
  std::vector<Ray> rays_;
  base::HeadPose predicted_;
  MatrixXd by_frame_;  ///< perturbation of machine_from_rig by the frame's parameters
  HeadCheck check_;
  bool cross_accused_ = false;
  bool spheres_tested_ = false;
};

void Check::collect(const base::ImageObservations& image, int camera) {
  for (const base::Observation& seen : image.observations) {
    if (seen.status != base::ObservationStatus::kCoded || !seen.centre_px.allFinite()) continue;
    const auto marker =
        std::find_if(known_.markers.begin(), known_.markers.end(), [&](const auto& m) { return m.id == seen.id; });
    if (marker == known_.markers.end()) continue;
    Eigen::Matrix2d cov = seen.cov_px2 * (known_.image_sigma_factor * known_.image_sigma_factor);
    if (!cov.allFinite() || !(cov.trace() > 0.0)) cov = Eigen::Matrix2d::Identity() * (known_.sigma0_px * known_.sigma0_px);
    rays_.push_back({camera, static_cast<Index>(marker - known_.markers.begin()), seen.centre_px, cov, detail::shape_of(seen)});
  }
}

/// The ellipses' centres become images of the circles' centres, as in the commissioning. A dot that one camera sees is explained by two
/// normals: its eccentricity is not known then, and is counted as noise.
void Check::reduce_centres() {
  const Pose rig_from_cross = predicted_.machine_from_rig.inverse() * known_.machine_from_cross;
  for (std::size_t m = 0; m < known_.markers.size(); ++m) {
    std::vector<detail::CircleView> views;
    std::vector<Ray*> seen;
    for (Ray& ray : rays_) {
      if (ray.marker != static_cast<Index>(m) || !(ray.shape_px2.trace() > 0.0)) continue;
      const base::Camera& camera = ray.camera == 1 ? known_.head.right : known_.head.left;
      views.push_back({camera.model(), camera.parameters().data(),
                       ray.camera == 1 ? known_.head.right_from_left * rig_from_cross : rig_from_cross, ray.shape_px2});
      seen.push_back(&ray);
    }
    if (views.empty()) continue;
    const auto circle = math::circle_of_pair(views, known_.markers[m].xyz_mm);
    for (std::size_t i = 0; i < views.size() && circle; ++i) {
      const auto offset = detail::eccentricity_px(views[i], known_.markers[m].xyz_mm, *circle);
      if (!offset) continue;
      if (views.size() > 1) {
        seen[i]->px -= *offset;
      } else {
        seen[i]->cov += *offset * offset->transpose();
      }
    }
  }
}

/// Derivatives of a pixel of one camera by everything that moves it.
bool Check::linearise(const Pose& machine_from_rig, const Pose& right_from_left, Linear& linear) const {
  const auto count = static_cast<Index>(rays_.size());
  MatrixXd by_known = MatrixXd::Zero(2 * count, known_.covariance.rows());
  linear.residual.resize(2 * count);
  linear.by_rig = MatrixXd::Zero(2 * count, 6);
  linear.by_head = MatrixXd::Zero(2 * count, 6);
  MatrixXd noise = MatrixXd::Zero(2 * count, 2 * count);
  const Pose rig_from_machine = machine_from_rig.inverse();
  const Eigen::Matrix3d rig_turn = rig_from_machine.rotation.toRotationMatrix();
  const Eigen::Matrix3d cross_turn = known_.machine_from_cross.rotation.toRotationMatrix();
  for (Index i = 0; i < count; ++i) {
    const Ray& ray = rays_[static_cast<std::size_t>(i)];
    const bool right = ray.camera == 1;
    const base::Camera& camera = right ? known_.head.right : known_.head.left;
    const Vector3d p_in_machine = known_.machine_from_cross * known_.markers[static_cast<std::size_t>(ray.marker)].xyz_mm;
    const Vector3d p_in_rig = rig_from_machine * p_in_machine;
    const Vector3d p_in_camera = right ? right_from_left * p_in_rig : p_in_rig;
    Eigen::Matrix<double, 2, 3> by_point;
    base::ProjectionParameterJacobian by_lens;
    const auto px = camera.project(p_in_camera, &by_point, &by_lens);
    if (!px) return false;
    linear.residual.segment<2>(2 * i) = ray.px - *px;
    by_known.block(2 * i, right ? at_.right : at_.left, 2, by_lens.cols()) = by_lens;
    Eigen::Matrix<double, 2, 3> by_rig_point = by_point;
    if (right) {
      Eigen::Matrix<double, 2, 6> by_pose;
      by_pose << -by_point * base::skew(p_in_camera), by_point;
      by_known.block<2, 6>(2 * i, at_.rig) = by_pose;
      linear.by_rig.middleRows<2>(2 * i) = by_pose;
      by_rig_point = by_point * right_from_left.rotation.toRotationMatrix();
    }
    const Eigen::Matrix<double, 2, 3> by_machine = by_rig_point * rig_turn;
    Eigen::Matrix<double, 2, 6> by_shift;  // by a perturbation of what the point is carried by, in machine
    by_shift << -by_machine * base::skew(p_in_machine), by_machine;
    linear.by_head.middleRows<2>(2 * i) = -by_shift;
    by_known.block<2, 6>(2 * i, at_.cross) = by_shift;
    by_known.block(2 * i, at_.frame, 2, at_.frame_size) = -by_shift * by_frame_;
    by_known.block<2, 3>(2 * i, at_.markers + 3 * ray.marker) = by_machine * cross_turn;
    noise.block<2, 2>(2 * i, 2 * i) = ray.cov;
  }
  linear.cov = by_known * known_.covariance * by_known.transpose() +
               linear.by_head * predicted_.stop_cov * linear.by_head.transpose() + noise;
  return true;
}

Result<> Check::against_cross() {
  for (;;) {
    if (static_cast<int>(rays_.size()) < kLeastMarkers) {
      return fail(ErrorCode::kNoUniqueSolution,
                  fmt::format("{} image points of markers of the cross are seen in this pair, {} are needed", rays_.size(),
                              kLeastMarkers));
    }
    Pose machine_from_rig = predicted_.machine_from_rig;
    Pose right_from_left = known_.head.right_from_left;
    Vector6d head_change = Vector6d::Zero();
    Vector6d rig_change = Vector6d::Zero();
    Linear linear;
    LinearEstimate both;
    for (int step = 0; step < kMaxSteps; ++step) {
      if (!linearise(machine_from_rig, right_from_left, linear)) {
        return fail(ErrorCode::kNoUniqueSolution,
                    "the pair cannot be compared: markers of the cross lie behind the cameras as predicted; is "
                    "the axis reading that of this pair?");
      }
      MatrixXd design(linear.residual.size(), 12);
      design << linear.by_rig, linear.by_head;
      // Changes so far are part of the model: about them, all of the change is estimated anew.
      VectorXd so_far(12);
      so_far << rig_change, head_change;
      both = linear_estimate(design, linear.residual + design * so_far, linear.cov);
      rig_change = both.x.head<6>();
      head_change = both.x.tail<6>();
      right_from_left = base::perturbed(known_.head.right_from_left, rig_change);
      machine_from_rig = base::perturbed(predicted_.machine_from_rig, head_change);
      if ((both.x - so_far).cwiseQuotient(both.cov.diagonal().cwiseSqrt()).norm() < 1e-3) break;
    }
    // A wrong id is not a moved head.
    double worst = 0.0;
    std::size_t culprit = 0;
    for (std::size_t i = 0; i < rays_.size(); ++i) {
      const auto at = 2 * static_cast<Index>(i);
      const Eigen::Matrix2d cov = both.residual_cov.block<2, 2>(at, at);
      const Vector2d residual = both.residual.segment<2>(at);
      const double square = residual.dot(cov.ldlt().solve(residual));
      if (square <= worst) continue;
      worst = square;
      culprit = i;
    }
    if (worst > math::chi_square_quantile(1.0 - kRayLevel, 2.0)) {
      const Ray& ray = rays_[culprit];
      check_.rejected.push_back(
          {ray.camera == 1 ? "right" : "left", known_.markers[static_cast<std::size_t>(ray.marker)].id,
           fmt::format("blunder: its residual is {:.1f} times what the sigmas allow", std::sqrt(0.5 * worst)),
           std::sqrt(0.5 * worst)});
      rays_.erase(rays_.begin() + static_cast<std::ptrdiff_t>(culprit));
      continue;
    }
    check_.rig_change = rig_change;
    check_.head_change = head_change;
    check_.rig_change_sigma = both.cov.diagonal().head<6>().cwiseSqrt();
    check_.head_change_sigma = both.cov.diagonal().tail<6>().cwiseSqrt();
    for (Index i = 0; i < 6; ++i) {
      check_.rig_seen[static_cast<std::size_t>(i)] = check_.rig_change_sigma(i) < (i < 3 ? kUnseen_rad : kUnseen_mm);
    }
    check_.rms_px = std::sqrt(both.residual.squaredNorm() / static_cast<double>(rays_.size()));
    check_.cross_markers = static_cast<int>(rays_.size());
    // All six together, and each as if it alone had moved, which is sharper for a single cause: seven tests share the level.
    const Matrix6d rig_cov = both.cov.topLeftCorner<6, 6>();
    HeadCheck::Test rig = chi_square_test("rig", statistic(rig_change, rig_cov), 6, options_.significance / 7.0);
    const Vector6d scale = rig_cov.diagonal().cwiseSqrt().cwiseInverse();
    const Matrix6d correlation = scale.asDiagonal() * rig_cov * scale.asDiagonal();
    const Matrix6d weight = scale.asDiagonal() * Matrix6d(correlation.inverse()) * scale.asDiagonal();
    for (Index i = 0; i < 6; ++i) {
      const double alone = weight.row(i).dot(rig_change) / std::sqrt(weight(i, i));
      rig.accused = rig.accused || std::erfc(std::abs(alone) / std::sqrt(2.0)) < options_.significance / 7.0;
    }
    check_.tests.push_back(std::move(rig));
    check_.tests.push_back(chi_square_test("head against cross", statistic(head_change, both.cov.bottomRightCorner<6, 6>()), 6,
                                           options_.significance));
    for (Index i = 0; i < 6; ++i) {
      HeadCheck::Test test{
          .name = kRigNames[i], .unit = i < 3 ? "rad" : "mm", .value = rig_change(i), .sigma = check_.rig_change_sigma(i)};
      test.dof = 1;
      test.statistic = std::pow(test.value / test.sigma, 2);
      test.p = std::erfc(std::sqrt(0.5 * test.statistic));
      check_.tests.push_back(std::move(test));  // tells what moved; the test of all six accuses
    }
    return {};
  }
}

/// Markers that both cameras see, of the cross or not.
std::vector<detail::CommonMarker> Check::common() const {
  const double factor = known_.image_sigma_factor * known_.image_sigma_factor;
  const auto usable = [&](const base::ImageObservations& image) {
    std::map<int, const base::Observation*> of_id;
    for (const base::Observation& seen : image.observations) {
      if (seen.status != base::ObservationStatus::kCoded || !seen.centre_px.allFinite()) continue;
      const auto [place, is_new] = of_id.emplace(seen.id, &seen);
      if (!is_new) place->second = nullptr;  // read twice: neither is believed
    }
    return of_id;
  };
  const auto covariance = [&](const base::Observation& seen) -> Eigen::Matrix2d {
    if (seen.cov_px2.allFinite() && seen.cov_px2.trace() > 0.0) return factor * seen.cov_px2;
    return Eigen::Matrix2d::Identity() * (known_.sigma0_px * known_.sigma0_px);
  };
  std::vector<detail::CommonMarker> markers;
  const auto right = usable(input_.right);
  for (const auto& [id, left] : usable(input_.left)) {
    const auto other = right.find(id);
    if (left == nullptr || other == right.end() || other->second == nullptr) continue;
    detail::CommonMarker& marker = markers.emplace_back();
    marker.id = id;
    marker.left_px = left->centre_px;
    marker.right_px = other->second->centre_px;
    marker.left_cov = covariance(*left);
    marker.right_cov = covariance(*other->second);
    marker.left_shape_px2 = detail::shape_of(*left);
    marker.right_shape_px2 = detail::shape_of(*other->second);
    detail::reduce_to_circle_centres(known_.head, marker);
  }
  return markers;
}

/// The rig by epipolar distances: all that a pair without the cross tells. Seven tests share the level, as with the cross.
Result<> Check::epipolar_only() {
  if (static_cast<int>(check_.common_markers) < static_cast<int>(detail::kLeastCommon)) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("{} image points of markers of the cross are seen in this pair ({} are needed), and {} markers by both "
                    "cameras ({} are needed to test the rig without the cross)",
                    rays_.size(), kLeastMarkers, check_.common_markers, detail::kLeastCommon));
  }
  const detail::RigCheck rig = detail::check_rig(known_.head, head_cov(), common(), kRayLevel);
  check_.rejected = rig.rejected;
  if (rig.dof == 0) {
    return fail(ErrorCode::kNoUniqueSolution,
                "the markers that both cameras see say nothing of the rig: too few of them agree");
  }
  check_.rig_change = rig.change;
  check_.rig_change_sigma = rig.sigma;
  check_.rig_seen = rig.seen;
  check_.epipolar_rms_px = rig.rms_px;
  HeadCheck::Test test = chi_square_test("rig", rig.statistic, rig.dof, options_.significance / 7.0);
  for (const double alone : rig.alone)
    test.accused = test.accused || std::erfc(std::abs(alone) / std::sqrt(2.0)) < options_.significance / 7.0;
  check_.tests.push_back(std::move(test));
  std::string unseen;
  for (std::size_t i = 0; i < 6; ++i) {
    if (!rig.seen[i]) {
      unseen += (unseen.empty() ? "" : ", ") + std::string(kRigNames[i]);
      continue;
    }
    const auto at = static_cast<Index>(i);
    HeadCheck::Test one{.name = kRigNames[i], .unit = i < 3 ? "rad" : "mm", .value = rig.change(at), .sigma = rig.sigma(at)};
    one.dof = 1;
    one.statistic = std::pow(one.value / one.sigma, 2);
    one.p = std::erfc(std::sqrt(0.5 * one.statistic));
    check_.tests.push_back(std::move(one));
  }
  check_.warnings.push_back(
      {"cross_not_seen", "cross",
       fmt::format("the cross is not in view: {} of the rig, and the head's place in the machine, are not tested",
                   unseen.empty() ? "nothing" : unseen)});
  return {};
}

void Check::second_reference() {
  if (input_.probed_again.empty()) return;
  // The cross's spheres, probed then and now; their common motion against no motion.
  std::vector<std::pair<const base::CommissionedSphere*, const base::ProbedSphere*>> pairs;
  for (const base::ProbedSphere& now : input_.probed_again) {
    const auto then = std::find_if(known_.spheres.begin(), known_.spheres.end(), [&](const auto& s) { return s.id == now.id; });
    if (then != known_.spheres.end()) pairs.emplace_back(&*then, &now);
  }
  if (pairs.size() < 3) {
    check_.warnings.push_back(
        {"few_spheres", "spheres",
         "fewer than three spheres of the commissioning were probed again: they do not tell the head from the cross"});
    return;
  }
  // Adjusted centres are common to all by machine_from_cross: the joint covariance is its part and the probing's.
  const auto count = static_cast<Index>(pairs.size());
  MatrixXd design(3 * count, 6);
  VectorXd y(3 * count);
  MatrixXd cov = MatrixXd::Zero(3 * count, 3 * count);
  for (Index i = 0; i < count; ++i) {
    const auto& [then, now] = pairs[static_cast<std::size_t>(i)];
    y.segment<3>(3 * i) = now->centre_mm - then->centre_mm;
    design.middleRows<3>(3 * i) << -base::skew(then->centre_mm), Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d frame =
        base::position_covariance({Eigen::Quaterniond::Identity(), then->centre_mm}, known_.machine_from_cross_cov);
    Eigen::Matrix3d own = then->cov_mm2 - frame;  // the ball's place on the cross
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(own);
    own = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
    cov.block<3, 3>(3 * i, 3 * i) = now->cov_mm2 + own;
  }
  const LinearEstimate moved = linear_estimate(design, y, cov);
  const MatrixXd total = moved.cov + known_.machine_from_cross_cov;
  check_.tests.push_back(chi_square_test("spheres", statistic(moved.x, total), 6, options_.significance));
  cross_accused_ = check_.tests.back().accused;
  spheres_tested_ = true;
}

void Check::conclude() {
  const auto accused = [&](const char* name) {
    return std::any_of(check_.tests.begin(), check_.tests.end(), [&](const auto& t) { return t.name == name && t.accused; });
  };
  const bool rig = accused("rig");
  const bool head = accused("head against cross");
  using Verdict = HeadCheck::Verdict;
  if (rig) {
    check_.verdict = Verdict::kRig;
    check_.message = "the cameras moved against each other since the commissioning: calibrate the rig and commission again";
    if (head) check_.message += "; the left camera also stands elsewhere against the cross";
  } else if (spheres_tested_ && (head || cross_accused_)) {
    check_.verdict = head && !cross_accused_ ? Verdict::kHead : head ? Verdict::kHeadOrCross : Verdict::kCross;
    check_.message =
        head && !cross_accused_
            ? "the head moved on its carriage: the spheres stand where they stood, the cameras do not; commission again"
            : "the cross moved on the machine, as its spheres say" +
                  std::string(head ? "; whether the head moved too is told only by a new commissioning" : "");
    if (head && cross_accused_) check_.verdict = Verdict::kCross;
  } else if (head) {
    check_.verdict = Verdict::kHeadOrCross;
    check_.message =
        "the head on its carriage or the cross on the machine moved; one pair cannot tell which: probe the spheres again";
  } else {
    check_.verdict = Verdict::kHolds;
    check_.message =
        check_.cross_markers > 0 ? "rig and frame hold" : "the rig holds, as far as markers beside the cross can tell";
  }
}

Result<HeadCheck> Check::run() {
  auto predicted = known_.frame.at(input_.axis_mm);
  if (!predicted) return fail(std::move(predicted));
  predicted_ = *predicted;
  by_frame_ = known_.frame.jacobian(input_.axis_mm);
  check_.axis_mm = input_.axis_mm;
  check_.level = options_.significance;
  collect(input_.left, 0);
  collect(input_.right, 1);
  reduce_centres();
  const std::vector<detail::CommonMarker> seen_by_both = common();
  check_.common_markers = static_cast<int>(seen_by_both.size());
  const bool cross_in_view = static_cast<int>(rays_.size()) >= kLeastMarkers;
  if (auto compared = cross_in_view ? against_cross() : epipolar_only(); !compared) return fail(std::move(compared));
  if (cross_in_view) {
    const VectorXd distances = detail::epipolar_of(known_.head, head_cov(), seen_by_both).residual_px;
    if (distances.size() > 0)
      check_.epipolar_rms_px = std::sqrt(distances.squaredNorm() / static_cast<double>(distances.size()));
  }
  second_reference();
  if (input_.temperature_c && known_.head.temperature_c) {
    const double off = *input_.temperature_c - *known_.head.temperature_c;
    if (std::abs(off) > options_.temperature_limit_c) {
      check_.warnings.push_back(
          {"head_temperature", "head",
           fmt::format("the head is {:+.1f} K from its calibration's temperature, more than {:.1f} K: let it warm up, or "
                       "calibrate it at this temperature",
                       off, options_.temperature_limit_c)});
    }
  }
  conclude();
  return check_;
}

}  // namespace

Result<> CheckOptions::validate() const {
  if (!(significance > 0.0 && significance < 0.5) || !(temperature_limit_c > 0.0)) {
    return fail(ErrorCode::kUsage, "the level of significance lies between 0 and 0.5, the limit of temperature is positive");
  }
  return {};
}

Result<HeadCheck> check_head(const CheckInput& input, const CheckOptions& options) {
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  if (input.commissioning == nullptr) return fail(ErrorCode::kUsage, "a check needs the result of a commissioning");
  auto layout = base::commissioning_layout(*input.commissioning);
  if (!layout) return fail(std::move(layout));
  return Check(input, options, *layout).run();
}

}  // namespace crosstie::bundle
