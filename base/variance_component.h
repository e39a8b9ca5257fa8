#pragma once

#include <string>

namespace crosstie::base {

/// How large the sigmas of a group of observations are, as the residuals of the whole adjustment tell.
struct VarianceComponent {
  std::string group;  ///< "image points c043", "scale bars", "control points", ...
  int observations = 0;
  double redundancy = 0.0;   ///< sum of the group's redundancy numbers, at the estimated sigmas
  double sigma_ratio = 1.0;  ///< estimated over stated sigma, without unit; 1 where it could not be estimated
  double sigma = 0.0;        ///< of sigma_ratio
  double low = 0.0;          ///< the true ratio lies between these with 95 %
  double high = 0.0;
  double p = 1.0;          ///< probability of a ratio at least this far from 1 (two-sided) if the stated sigmas are true
  bool estimated = false;  ///< false: too little redundancy; the stated sigmas were kept
};

}  // namespace crosstie::base
