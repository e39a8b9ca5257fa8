#include "verify/detail/test_lengths.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace crosstie::verify::detail {
namespace {

using base::LengthDeviation;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Pairs that are looked at before the selection; of larger sets every k-th pair is.
constexpr std::size_t kMaxCandidates = 1'000'000;

struct Candidate {
  double nominal_mm;
  std::size_t a;
  std::size_t b;
};

bool defines_scale(const CompareOptions& options, int id_a, int id_b) {
  return std::any_of(options.defining_lengths.begin(), options.defining_lengths.end(), [&](const auto& ids) {
    return (ids.first == id_a && ids.second == id_b) || (ids.first == id_b && ids.second == id_a);
  });
}

std::vector<Candidate> candidates(const Partners& partners, const CompareOptions& options) {
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < partners.pairs.size(); ++i) {
    if (partners.used[i]) used.push_back(i);
  }
  const std::size_t pairs = used.size() * (used.size() - 1) / 2;
  const std::size_t stride = pairs / kMaxCandidates + 1;
  std::vector<Candidate> result;
  std::size_t next = 0;  // of the pairs of i, the first that is looked at: pairs are numbered row by row
  for (std::size_t i = 0; i < used.size(); ++i) {
    const std::size_t row = used.size() - 1 - i;
    for (; next < row; next += stride) {
      const std::size_t j = i + 1 + next;
      if (defines_scale(options, partners.ids[used[i]], partners.ids[used[j]])) continue;
      result.push_back({(partners.pairs[used[i]].a_mm - partners.pairs[used[j]].a_mm).norm(), used[i], used[j]});
    }
    next -= row;
  }
  std::sort(result.begin(), result.end(), [](const Candidate& p, const Candidate& q) {
    return std::tie(p.nominal_mm, p.a, p.b) < std::tie(q.nominal_mm, q.a, q.b);
  });
  return result;
}

/// Variance of |p_a - p_b| along the unit vector u.
double length_variance(const Matrix3d& cov_a, const Matrix3d& cov_b, const Matrix3d& cov_ab, const Vector3d& u) {
  return u.dot((cov_a + cov_b - cov_ab - cov_ab.transpose()) * u);
}

}  // namespace

std::vector<LengthDeviation> test_lengths(const Partners& partners, double scale, const CompareOptions& options) {
  const std::vector<Candidate> all = candidates(partners, options);
  const std::size_t wanted = std::min(all.size(), static_cast<std::size_t>(options.max_lengths));
  std::vector<LengthDeviation> lengths;
  for (std::size_t k = 0; k < wanted; ++k) {
    const std::size_t rank = wanted == all.size() ? k : (k + 1) * all.size() / wanted - 1;  // the last is the longest
    const auto& [nominal_mm, a, b] = all[rank];
    const Vector3d in_reference = partners.pairs[a].a_mm - partners.pairs[b].a_mm;
    const Vector3d in_measured = partners.pairs[a].b_mm - partners.pairs[b].b_mm;
    LengthDeviation length{
        partners.ids[a], partners.ids[b], nominal_mm, scale * in_measured.norm(), 0.0, options.mpe.at_mm(nominal_mm)};
    if (partners.has_covariance[a] && partners.has_covariance[b] && nominal_mm > 0.0 && in_measured.norm() > 0.0) {
      Matrix3d cov_a = partners.pairs[a].cov_b_mm2;
      Matrix3d cov_b = partners.pairs[b].cov_b_mm2;
      Matrix3d cov_ab = Matrix3d::Zero();
      if (options.measured_cov_mm2.size() > 0) {
        const auto row = 3 * static_cast<Index>(partners.measured_index[a]);
        const auto column = 3 * static_cast<Index>(partners.measured_index[b]);
        cov_a = options.measured_cov_mm2.block<3, 3>(row, row);
        cov_b = options.measured_cov_mm2.block<3, 3>(column, column);
        cov_ab = options.measured_cov_mm2.block<3, 3>(row, column);
      }
      const double measured = length_variance(cov_a, cov_b, cov_ab, in_measured.normalized());
      const double reference = length_variance(partners.pairs[a].cov_a_mm2, partners.pairs[b].cov_a_mm2, Matrix3d::Zero(),
                                               in_reference / nominal_mm);
      length.sigma_mm = std::sqrt(std::max(0.0, scale * scale * measured + reference));
    }
    lengths.push_back(length);
  }
  return lengths;
}

}  // namespace crosstie::verify::detail
