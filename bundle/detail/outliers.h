#pragma once

#include <string>
#include <vector>

#include "bundle/adjust.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/weights.h"

namespace crosstie::bundle::detail {

/// Why rays, points and images do not take part. An empty text: they do, or a reason is still to be found.
struct Reasons {
  std::vector<std::string> ray;
  std::vector<std::string> point;
  std::vector<std::string> image;

  explicit Reasons(const Survey& survey) : ray(survey.rays.size()), point(survey.ids.size()), image(survey.images.size()) {}
};

/// Standardised residual of a group: sqrt(v' Qvv^+ v / rank), over the a priori sigma; directions that nothing controls
/// (redundancy under 0.001) do not count.
double standardised(const Eigen::VectorXd& whitened_residual, const Eigen::MatrixXd& residual_cofactor);

/// Standardised residual of each ray against the network: of active ones from their residual, of others from their prediction
/// and its covariance; 0 where image or point is unknown.
std::vector<double> standardised_of_rays(const Survey& survey, const State& state, const Estimate& at, const Weights& weights);

/// Takes out what cannot be adjusted: images with fewer than four active rays, points with fewer than two or whose rays meet at
/// less than options.min_angle_rad, until nothing changes. Reasons are written.
void prune(const Survey& survey, const AdjustOptions& options, State& state, Reasons& reasons);

/// Sorts out the points on whose position their rays do not agree: gives a place to those on which half of the rays do, and
/// rejects those that stand at different places in different images as moved. `tolerance_px` is what agreement means.
void sort_out_points(const Survey& survey, const AdjustOptions& options, double tolerance_px, State& state, Reasons& reasons);

/// Deactivates the rays whose standardised residual (over sigma0 a posteriori) exceeds Pope's critical value: the largest one,
/// and others that share neither image nor point with a larger one, up to a tenth of all. Returns how many.
int reject_largest(const Survey& survey, const AdjustOptions& options, const Estimate& at, State& state);

/// Activates the rejected rays that agree with the network after all, and of an id read twice in an image the one that does.
int readmit(const Survey& survey, const AdjustOptions& options, const std::vector<double>& w, double sigma0, int redundancy,
            const Reasons& reasons, State& state);

/// A reason for every ray that is not active, in words.
void explain(const Survey& survey, const State& state, double tolerance_px, Reasons& reasons);

}  // namespace crosstie::bundle::detail
