#include "math/minimise.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <mutex>
#include <set>

#include <ceres/ceres.h>
#include <glog/logging.h>

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

/// Poses with the left perturbation as tangent. Measurements give their Jacobians by the tangent already, in the first six
/// columns of the seven that Ceres provides; the Jacobian of Plus only picks these out.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    pose_to_values(base::perturbed(pose_from_values(x), Eigen::Map<const base::Vector6d>(delta)), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian, 7, 6).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<base::Vector6d>(y_minus_x, 6) = base::difference(pose_from_values(x), pose_from_values(y));
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian, 6, 7).setIdentity();
    return true;
  }
};

class MeasurementCost final : public ceres::CostFunction {
 public:
  MeasurementCost(const Model& model, const Measurement& measurement) : measurement_(measurement) {
    set_num_residuals(measurement.rows());
    for (const int b : measurement.blocks()) {
      const Block& block = model.blocks[static_cast<std::size_t>(b)];
      mutable_parameter_block_sizes()->push_back(static_cast<int>(block.values.size()));
      is_pose_.push_back(block.is_pose());
    }
  }

  bool Evaluate(double const* const* values, double* residuals, double** jacobians) const override {
    if (!measurement_.evaluate(values, residuals, jacobians)) return false;
    if (jacobians == nullptr) return true;
    for (std::size_t i = 0; i < is_pose_.size(); ++i) {
      if (!is_pose_[i] || jacobians[i] == nullptr) continue;
      // From rows of six to rows of seven, in place and therefore from behind.
      for (int row = num_residuals() - 1; row >= 0; --row) {
        double* to = jacobians[i] + 7 * row;
        std::copy_backward(jacobians[i] + 6 * row, jacobians[i] + 6 * row + 6, to + 6);
        to[6] = 0.0;
      }
    }
    return true;
  }

 private:
  const Measurement& measurement_;
  std::vector<bool> is_pose_;
};

/// Ceres speaks through glog on stderr; while one of these lives it does not. The level is the process's, hence the count.
class QuietLog {
 public:
  QuietLog() {
    const std::lock_guard lock(mutex_);
    if (count_++ == 0) {
      before_ = FLAGS_minloglevel;
      FLAGS_minloglevel = google::GLOG_FATAL;
    }
  }
  ~QuietLog() {
    const std::lock_guard lock(mutex_);
    if (--count_ == 0) FLAGS_minloglevel = before_;
  }
  QuietLog(const QuietLog&) = delete;
  QuietLog& operator=(const QuietLog&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int count_ = 0;
  static inline int before_ = 0;
};

class StopWhenAsked final : public ceres::IterationCallback {
 public:
  explicit StopWhenAsked(const base::Progress& progress) : progress_(progress) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return progress_.cancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const base::Progress& progress_;
};

/// The values of all blocks in one piece of memory, in the order of the blocks: Ceres sorts by address, and sums in that order.
class Values {
 public:
  explicit Values(const Model& model) {
    for (const Block& block : model.blocks) {
      first_.push_back(all_.size());
      all_.insert(all_.end(), block.values.begin(), block.values.end());
    }
  }
  [[nodiscard]] double* of(std::size_t block) { return all_.data() + first_[block]; }
  void write_to(Model& model) const {
    for (std::size_t b = 0; b < first_.size(); ++b) {
      std::copy_n(all_.begin() + static_cast<std::ptrdiff_t>(first_[b]), model.blocks[b].values.size(),
                  model.blocks[b].values.begin());
    }
  }

 private:
  std::vector<std::size_t> first_;
  std::vector<double> all_;
};

/// Points are eliminated first, those aside that a measurement joins to each other.
std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order(const Model& model, const std::vector<bool>& used,
                                                                 Values& values) {
  std::set<int> joined;
  for (const auto& measurement : model.measurements) {
    std::vector<int> eliminated;
    for (const int b : measurement->blocks()) {
      if (model.blocks[static_cast<std::size_t>(b)].role == BlockRole::kEliminated) eliminated.push_back(b);
    }
    if (eliminated.size() > 1) joined.insert(eliminated.begin(), eliminated.end());
  }
  auto order = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    if (!used[b]) continue;
    const bool first = model.blocks[b].role == BlockRole::kEliminated && !joined.contains(static_cast<int>(b));
    order->AddElementToGroup(values.of(b), first ? 0 : 1);
  }
  return order;
}

Result<MinimiseSummary> solve(Model& model, const MinimiseOptions& options, const base::Progress& progress) {
  PoseManifold pose_manifold;
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  std::unique_ptr<ceres::LossFunction> loss;
  if (options.robust_scale) loss = std::make_unique<ceres::CauchyLoss>(*options.robust_scale);
  std::vector<std::unique_ptr<ceres::Manifold>> subsets;
  ceres::Problem problem(ownership);
  Values all(model);

  std::vector<bool> used(model.blocks.size(), false);
  int poses = 0;
  for (const auto& measurement : model.measurements) {
    std::vector<double*> values;
    for (const int b : measurement->blocks()) {
      const Block& block = model.blocks[static_cast<std::size_t>(b)];
      values.push_back(all.of(static_cast<std::size_t>(b)));
      if (used[static_cast<std::size_t>(b)]) continue;
      used[static_cast<std::size_t>(b)] = true;
      problem.AddParameterBlock(values.back(), static_cast<int>(block.values.size()));
      if (block.free.empty()) {
        problem.SetParameterBlockConstant(values.back());
      } else if (block.is_pose()) {
        problem.SetManifold(values.back(), &pose_manifold);
        ++poses;
      } else if (static_cast<int>(block.free.size()) < block.tangent_size()) {
        std::vector<int> held;
        for (int i = 0; i < block.tangent_size(); ++i) {
          if (!std::binary_search(block.free.begin(), block.free.end(), i)) held.push_back(i);
        }
        subsets.push_back(std::make_unique<ceres::SubsetManifold>(block.tangent_size(), held));
        problem.SetManifold(values.back(), subsets.back().get());
      }
    }
    problem.AddResidualBlock(new MeasurementCost(model, *measurement), measurement->may_be_wrong() ? loss.get() : nullptr,
                             values);
  }

  ceres::Solver::Options solver;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  // The damping never vanishes, so that a free datum leaves the equations regular; 1e-8 of the diagonal slows no convergence.
  solver.max_trust_region_radius = 1e8;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-12;
  constexpr int kDensePoses = 150;
  solver.linear_solver_type = poses <= kDensePoses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = elimination_order(model, used, all);
  StopWhenAsked stop(progress);
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (progress.cancelled()) return base::cancelled("the adjustment");
  if (!summary.IsSolutionUsable()) {
    return fail(ErrorCode::kNoUniqueSolution, "the minimisation found no solution: " + summary.message);
  }
  all.write_to(model);
  return MinimiseSummary{static_cast<int>(summary.iterations.size()), summary.final_cost};
}

}  // namespace

Result<MinimiseSummary> minimise(Model& model, const MinimiseOptions& options, const base::Progress& progress) {
  const QuietLog quiet;
  try {
    return solve(model, options, progress);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kFileSystem, "not enough memory");
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, std::string("the minimisation failed: ") + error.what());
  }
}

}  // namespace crosstie::math
