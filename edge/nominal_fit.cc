#include "edge/nominal_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/core.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "edge/detail/foreign_stretch.h"
#include "edge/detail/form.h"
#include "edge/detail/nominal_problem.h"
#include "edge/detail/nominal_start.h"
#include "math/distributions.h"

namespace crosstie::edge {
namespace {

using base::EdgeCurve;
using base::ErrorCode;
using base::fail;
using base::Result;
using detail::NominalProblem;
using detail::NominalStart;
using detail::NominalState;

constexpr std::size_t kFollowedStarts = 3;
constexpr double kKnownTurn_rad = 1.0 / 3.0;  // a turn with a larger sigma is not known at all
constexpr double kLeastEigenvalue = 1e-12;    // of the normal matrix scaled to unit diagonal
constexpr double kFormProbability = 0.999;
constexpr double kMirrorGain = 4.0;  // a mirror image that fits so many times better (v'Pv) is what was meant

Result<> check_edge(const EdgeCurve& edge) {
  if (edge.points.size() < 3) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("the rim has {} points; a nominal hole needs more", edge.points.size()));
  }
  if (edge.shared_mm.cols() > 0 && edge.shared_mm.rows() != static_cast<Eigen::Index>(3 * edge.points.size())) {
    return fail(ErrorCode::kInternal, "the rim's shared errors are not those of its points");
  }
  for (std::size_t i = 0; i < edge.points.size(); ++i) {
    const base::EdgePoint& p = edge.points[i];
    if (!p.point_mm.allFinite() || !p.cov_mm2.allFinite() || !(p.cov_mm2.diagonal().minCoeff() > 0.0)) {
      return fail(ErrorCode::kBadInput, fmt::format("point {} of the rim has no covariance, or is not finite", i + 1));
    }
    if (!(std::abs(p.normal.norm() - 1.0) < 1e-3)) {
      return fail(ErrorCode::kBadInput, fmt::format("point {} of the rim has no normal", i + 1));
    }
  }
  return {};
}

/// A nominal that is as many times larger or smaller than the rim as two units are was read in the wrong one.
Result<> check_unit(const EdgeCurve& edge, const NominalCurve& nominal) {
  if (!edge.closed || !nominal.closed() || !(edge.length_mm > 0.0)) return {};
  constexpr double kNear = 0.05;
  const double ratio = edge.length_mm / nominal.length_mm();
  for (const auto& [factor, units] : {std::pair{25.4, "inches read as mm"},
                                      {1.0 / 25.4, "mm read as inches"},
                                      {1000.0, "metres read as mm"},
                                      {0.001, "mm read as metres"}}) {
    if (std::abs(ratio / factor - 1.0) > kNear) continue;
    return fail(ErrorCode::kBadInput,
                fmt::format("the rim is {:.1f} mm long and its nominal {:.1f} mm: the nominal looks like {}", edge.length_mm,
                            nominal.length_mm(), units));
  }
  return {};
}

/// Whether the mirror image is another curve, and which of the two a rim is can be told.
bool has_handedness(const Nominal& nominal) {
  if (nominal.kind == NominalKind::kPoints) return !nominal.normals.empty();
  if (!nominal.saddle || nominal.kind == NominalKind::kCircle) return false;
  const double quarter = nominal.saddle->direction_rad / (0.5 * std::numbers::pi);
  return std::abs(quarter - std::round(quarter)) > 1e-9;
}

struct Solved {
  Nominal nominal;
  NominalState state;
  NominalProblem::Normals normals;
  std::vector<int> free;
  bool turn_is_held = false;
  int iterations = 0;
};

long redundancy_of(const Solved& solved) { return solved.normals.rows - static_cast<long>(solved.free.size()); }

/// Sigma of the turn about the normal; infinite where nothing determines it.
double turn_sigma(const Eigen::MatrixXd& matrix) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(matrix);
  const Eigen::VectorXd column = ldlt.solve(Eigen::VectorXd::Unit(matrix.rows(), 2));
  const bool solved = (matrix * column - Eigen::VectorXd::Unit(matrix.rows(), 2)).norm() < 1e-3;
  return solved && column(2) > 0.0 ? std::sqrt(column(2)) : HUGE_VAL;
}

Result<Solved> solve_from(const EdgeCurve& edge, const NominalStart& start, bool fit_size, bool hold_turn) {
  const NominalProblem problem(edge, start.nominal, fit_size, hold_turn);
  Solved solved;
  solved.nominal = start.nominal;
  solved.state.frame_from_hole = start.frame_from_hole;
  solved.state.size_mm = start.nominal.size_mm;
  solved.state.shared = Eigen::VectorXd::Zero(edge.shared_mm.cols());
  solved.free = problem.free();
  solved.turn_is_held = hold_turn;
  if (!problem.solve(solved.state, solved.normals, solved.iterations)) {
    return fail(ErrorCode::kNoUniqueSolution, "the fit of the nominal hole does not come to rest");
  }
  if (!hold_turn && !(turn_sigma(solved.normals.matrix) < kKnownTurn_rad)) {
    NominalStart again = start;
    again.frame_from_hole = solved.state.frame_from_hole;
    if (!solved.state.size_mm.empty()) again.nominal.size_mm = solved.state.size_mm;
    return solve_from(edge, again, fit_size, true);
  }
  solved.nominal.size_mm = solved.state.size_mm;
  return solved;
}

Result<Solved> best_of(const EdgeCurve& edge, const std::vector<NominalStart>& starts, bool fit_size) {
  Result<Solved> best = fail(ErrorCode::kNoUniqueSolution, "the points of the rim are in one place");
  for (std::size_t i = 0; i < std::min(kFollowedStarts, starts.size()); ++i) {
    const bool is_round = starts[i].nominal.kind == NominalKind::kCircle && !starts[i].nominal.saddle;
    auto one = solve_from(edge, starts[i], fit_size, is_round);
    if (i == 0 || (one && (!best || one->normals.square_sum < best->normals.square_sum))) best = std::move(one);
  }
  return best;
}

/// Whether the points deviate from the nominal by more than noise does.
bool deviates(double square_sum, long redundancy) {
  return redundancy > 0 && square_sum > math::chi_square_quantile(kFormProbability, static_cast<double>(redundancy));
}

/// A rim without the stretches that do not belong to the nominal, and the fit to it; nothing where there are none.
struct WithoutStretches {
  EdgeCurve rim;
  Solved solved;
  std::vector<ForeignStretch> stretches;
};
std::optional<WithoutStretches> solve_without_stretches(const EdgeCurve& edge, const Solved& solved, bool fit_size) {
  const NominalStart start{solved.nominal, solved.state.frame_from_hole, 0.0};
  const auto fit_part = [&](const EdgeCurve& part) -> std::optional<detail::PartFit> {
    auto fitted = solve_from(part, start, fit_size, solved.turn_is_held);
    if (!fitted) return std::nullopt;
    return detail::PartFit{std::move(fitted->state), fitted->normals.square_sum, redundancy_of(*fitted)};
  };
  auto split = detail::without_foreign_stretches(edge, solved.nominal, fit_part);
  if (!split) return std::nullopt;
  EdgeCurve rim = detail::part_of(edge, split->keep);
  auto rest = solve_from(rim, start, fit_size, solved.turn_is_held);
  if (!rest) return std::nullopt;
  return WithoutStretches{std::move(rim), *std::move(rest), std::move(split->stretches)};
}

/// Lets the rim's form count: its variance joins those of the points, and both are found in turn. `rim` and `solved` become those with it.
RimForm let_form_count(EdgeCurve& rim, Solved& solved, bool fit_size) {
  const bool contradicts = deviates(solved.normals.square_sum, redundancy_of(solved));
  constexpr int kRounds = 3;
  const EdgeCurve plain = rim;
  RimForm form;
  for (int round = 0; round < kRounds; ++round) {
    const NominalProblem problem(plain, solved.nominal, fit_size, solved.turn_is_held);
    const RimForm found = detail::form_of(plain, problem, solved.state, contradicts);
    if (found.none()) break;
    EdgeCurve weighted = detail::with_form(plain, found);
    auto again = solve_from(weighted, {solved.nominal, solved.state.frame_from_hole, 0.0}, fit_size, solved.turn_is_held);
    if (!again) break;
    form = found;
    rim = std::move(weighted);
    solved = *std::move(again);
  }
  return form;
}

/// Inverse of the normal matrix over the free unknowns, [pose, sizes], and the shared causes.
Result<Eigen::MatrixXd> cofactors(const EdgeCurve& edge, const Solved& solved, bool fit_size) {
  const Eigen::VectorXd scale = solved.normals.matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * solved.normals.matrix * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const auto count = static_cast<Eigen::Index>(solved.free.size());
  if (!(eigen.eigenvalues()(0) > kLeastEigenvalue)) {
    Eigen::Index weakest = 0;
    eigen.eigenvectors().col(0).head(count).cwiseAbs().maxCoeff(&weakest);
    const NominalProblem problem(edge, solved.nominal, fit_size, solved.turn_is_held);
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("the measured rim leaves {} of the nominal {} free",
                    problem.name_of_unknown(solved.free[static_cast<std::size_t>(weakest)]), name_of(solved.nominal.kind)));
  }
  return (scale.asDiagonal() *
          (eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose()) *
          scale.asDiagonal())
      .eval();
}

/// From the hole's own axes into base::Pose's convention.
Eigen::MatrixXd covariance_of(const Solved& solved, const Eigen::MatrixXd& cofactor) {
  const auto sizes = static_cast<Eigen::Index>(solved.nominal.size_mm.size());
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(6 + sizes, 6 + sizes);
  for (std::size_t i = 0; i < solved.free.size(); ++i) {
    for (std::size_t j = 0; j < solved.free.size(); ++j) {
      full(solved.free[i], solved.free[j]) = cofactor(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  Eigen::MatrixXd left = Eigen::MatrixXd::Identity(6 + sizes, 6 + sizes);
  left.topLeftCorner<6, 6>() = solved.state.frame_from_hole.adjoint();
  return left * full * left.transpose();
}

/// A list whose normals follow from its sense is turned round where these point away from the head.
void face_head(const EdgeCurve& edge, NominalFit& fit) {
  if (fit.nominal.kind != NominalKind::kPoints || !fit.nominal.normals.empty()) return;
  const auto curve = NominalCurve::make(fit.nominal);
  if (!curve) return;
  Eigen::Vector3d towards_head = Eigen::Vector3d::Zero();
  for (const auto& p : edge.points) towards_head += p.normal;
  if ((fit.frame_from_hole.rotation * curve->at(0.0).normal).dot(towards_head) >= 0.0) return;
  std::reverse(fit.nominal.points_mm.begin(), fit.nominal.points_mm.end());
}

/// Root mean squares of the points that were fitted.
void add_rms(NominalFit& fit) {
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  double count = 0.0;
  for (std::size_t k = 0; k < fit.deviations.points.size(); ++k) {
    const auto holds = [&](const ForeignStretch& stretch) {
      return std::find(stretch.points.begin(), stretch.points.end(), fit.deviations.points[k]) != stretch.points.end();
    };
    if (std::any_of(fit.left_out.begin(), fit.left_out.end(), holds)) continue;
    squares += fit.deviations.uv_mm.col(static_cast<Eigen::Index>(k)).cwiseAbs2();
    count += 1.0;
  }
  squares /= std::max(1.0, count);
  fit.rms_u_mm = std::sqrt(squares(0));
  fit.rms_v_mm = std::sqrt(squares(1));
  fit.rms_mm = std::sqrt(squares.sum());
}

void describe(NominalFit& fit) {
  add_rms(fit);
  for (const ForeignStretch& stretch : fit.left_out) {
    fit.warnings.push_back(
        {"stretch_left_out", std::string(name_of(fit.nominal.kind)),
         fmt::format(
             "from {:.1f} to {:.1f} mm along the rim {} points lie up to u = {:+.3f} mm off the nominal that the others "
             "follow to {:.3f} mm rms: a break-out, spatter or another edge; they are not in the fit",
             stretch.from_mm, stretch.from_mm + stretch.length_mm, stretch.points.size(), stretch.most_u_mm, fit.rms_u_mm)});
  }
  if (fit.turn_is_held) {
    fit.warnings.push_back({"turn_held", std::string(name_of(fit.nominal.kind)),
                            "nothing determines how the hole is turned about its normal; it is left as it was found"});
  }
  if (!fit.form.none() || deviates(fit.sigma0 * fit.sigma0 * static_cast<double>(fit.redundancy), fit.redundancy)) {
    const auto said = [](const FormComponent& component) {
      if (component.parts.empty()) return std::string("none");
      return fmt::format("{:.3f} mm over {:.0f} mm of rim", component.sigma_mm(), component.length_mm());
    };
    fit.warnings.push_back(
        {"form", std::string(name_of(fit.nominal.kind)),
         fmt::format(
             "the rim deviates from its nominal by {:.3f} mm rms, {:.1f} times what its sigmas explain: the hole has a form "
             "of its own (across the rim {}, along the normal {}), and weights and sigmas of its place and sizes allow for it",
             fit.rms_mm, fit.sigma0, said(fit.form.across), said(fit.form.along_normal))});
  }
}

}  // namespace

double EdgeDeviations::sigma_mm(std::size_t i, int row) const {
  const auto at = static_cast<Eigen::Index>(2 * i) + row;
  return std::sqrt(cov_mm2[i](row, row) + (shared_mm.cols() > 0 ? shared_mm.row(at).squaredNorm() : 0.0));
}

double FormComponent::cov_mm2(double distance_mm) const {
  constexpr double kMaternFalls = 2.904;  // (1 + a + a^2 / 3) exp(-a) is 1/e there
  const auto correlation = [&](const Part& part) {
    if (!(part.length_mm > 0.0)) return distance_mm > 0.0 ? 0.0 : 1.0;
    const double a = kMaternFalls * distance_mm / part.length_mm;
    return part.smooth ? (1.0 + a + a * a / 3.0) * std::exp(-a) : std::exp(-distance_mm / part.length_mm);
  };
  double sum = 0.0;
  for (const Part& part : parts) sum += part.variance_mm2 * correlation(part);
  return sum;
}

double FormComponent::sigma_mm() const { return std::sqrt(cov_mm2(0.0)); }

double FormComponent::length_mm() const {
  double sum = 0.0;
  for (const Part& part : parts) sum += part.variance_mm2 * part.length_mm;
  return parts.empty() ? 0.0 : sum / cov_mm2(0.0);
}

double NominalFit::size_sigma_mm(std::size_t i) const {
  const auto at = static_cast<Eigen::Index>(6 + i);
  return std::sqrt(covariance(at, at));
}

EdgeDeviations deviations(const EdgeCurve& edge, const NominalCurve& nominal, const base::Pose& frame_from_hole) {
  EdgeDeviations result;
  const base::Pose back = frame_from_hole.inverse();
  const Eigen::Matrix3d turn = back.rotation.toRotationMatrix();
  std::vector<Eigen::Vector2d> uv, tilts;
  std::vector<Eigen::MatrixXd> shared;
  for (std::size_t i = 0; i < edge.points.size(); ++i) {
    const Eigen::Vector3d q = back * edge.points[i].point_mm;
    const CurvePoint place = nominal.nearest(q);
    const Eigen::Vector3d off = q - place.point_mm;
    if (!nominal.closed() && std::abs(off.dot(place.tangent)) > 1e-3 * off.norm() + 1e-6) continue;
    Eigen::Matrix<double, 2, 3> across;
    across << place.normal.cross(place.tangent).transpose(), place.normal.transpose();
    const Eigen::Matrix<double, 2, 3> e = across * turn;
    result.points.push_back(i);
    result.s_mm.push_back(place.s_mm);
    const Eigen::Vector3d normal = turn * edge.points[i].normal;
    tilts.emplace_back(Eigen::Vector2d(normal.dot(across.row(0)), normal.dot(place.tangent)) / normal.dot(place.normal));
    uv.emplace_back(across * off);
    result.cov_mm2.emplace_back(e * edge.points[i].cov_mm2 * e.transpose());
    if (edge.shared_mm.cols() > 0) shared.emplace_back(e * edge.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * i)));
  }
  const auto n = static_cast<Eigen::Index>(uv.size());
  result.uv_mm.resize(2, n);
  result.tilt_rad.resize(2, n);
  result.shared_mm.resize(2 * n, edge.shared_mm.cols());
  for (Eigen::Index i = 0; i < n; ++i) {
    result.uv_mm.col(i) = uv[static_cast<std::size_t>(i)];
    result.tilt_rad.col(i) = tilts[static_cast<std::size_t>(i)];
    if (edge.shared_mm.cols() > 0) result.shared_mm.middleRows<2>(2 * i) = shared[static_cast<std::size_t>(i)];
  }
  return result;
}

Result<NominalFit> fit_nominal(const EdgeCurve& edge, const Nominal& nominal, const NominalFitOptions& options) {
  if (auto good = check_edge(edge); !good) return fail(std::move(good));
  const bool has_sizes = !size_names(nominal.kind).empty();
  const bool fit_size = has_sizes && (options.fit_size || nominal.size_mm.empty());
  if (!has_sizes || !nominal.size_mm.empty()) {
    const auto curve = NominalCurve::make(nominal);
    if (!curve) return tl::unexpected(curve.error());
    if (auto good = check_unit(edge, *curve); !good) return fail(std::move(good));
  }
  std::vector<NominalStart> starts;
  if (!options.frame_from_hole || (has_sizes && nominal.size_mm.empty())) starts = detail::nominal_starts(edge, nominal);
  if (options.frame_from_hole) {
    if (starts.empty()) starts = {{nominal, {}, 0.0}};
    starts.resize(1);
    starts[0].frame_from_hole = *options.frame_from_hole;
  }
  auto solved = best_of(edge, starts, fit_size);
  if (!solved) return fail(std::move(solved));
  long redundancy = redundancy_of(*solved);
  if (redundancy < 0) {
    return fail(ErrorCode::kNoUniqueSolution, fmt::format("{} points of the rim do not determine {} unknowns of a nominal {}",
                                                          edge.points.size(), solved->free.size(), name_of(nominal.kind)));
  }
  if (has_handedness(nominal)) {
    if (deviates(solved->normals.square_sum, redundancy)) {
      const auto other = best_of(edge, detail::nominal_starts(edge, mirrored(nominal)), fit_size);
      if (other && other->normals.square_sum * kMirrorGain < solved->normals.square_sum) {
        const auto rms = [&](const Solved& s) { return std::sqrt(s.normals.square_sum / static_cast<double>(s.normals.rows)); };
        return fail(
            ErrorCode::kBadInput,
            fmt::format("the nominal {} fits the rim only as its mirror image (deviation over sigma {:.3g} as it is, {:.3g} "
                        "mirrored): it was drawn as seen from the other side, or one of its axes is reversed",
                        name_of(nominal.kind), rms(*solved), rms(*other)));
      }
    }
  }
  NominalFit fit;
  EdgeCurve rim = edge;
  if (options.leave_out_stretches && deviates(solved->normals.square_sum, redundancy)) {
    if (auto rest = solve_without_stretches(edge, *solved, fit_size)) {
      rim = std::move(rest->rim);
      solved = std::move(rest->solved);
      fit.left_out = std::move(rest->stretches);
      redundancy = redundancy_of(*solved);
    }
  }
  fit.sigma0 = redundancy > 0 ? std::sqrt(solved->normals.square_sum / static_cast<double>(redundancy)) : 0.0;
  fit.form = let_form_count(rim, *solved, fit_size);
  const auto cofactor = cofactors(edge, *solved, fit_size);
  if (!cofactor) return tl::unexpected(cofactor.error());
  const NominalProblem problem(rim, solved->nominal, fit_size, solved->turn_is_held);
  const auto covariance = detail::covariance_with_form(rim, problem, solved->state, fit.form, *cofactor);
  if (!covariance) return fail(ErrorCode::kNoUniqueSolution, "the sizes that fit the rim make no curve");
  fit.nominal = solved->nominal;
  fit.frame_from_hole = solved->state.frame_from_hole;
  fit.covariance = covariance_of(*solved, *covariance);
  fit.turn_is_held = solved->turn_is_held;
  fit.iterations = solved->iterations;
  fit.redundancy = redundancy;
  face_head(edge, fit);
  const auto curve = NominalCurve::make(fit.nominal);
  if (!curve) return tl::unexpected(curve.error());
  fit.deviations = deviations(edge, *curve, fit.frame_from_hole);
  describe(fit);
  return fit;
}

}  // namespace crosstie::edge
