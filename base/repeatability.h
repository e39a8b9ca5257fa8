#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace crosstie::base {

/// A quantity that was measured several times.
struct RepeatedQuantity {
  std::string name;  ///< "point 11 x", "rim 45 deg, radial", "p1 PS"
  std::string unit = "mm";
  std::vector<double> values = {};
  std::vector<double> sigmas = {};  ///< predicted, one for each value; empty where none is known
  double mean = 0.0;
  double sd = 0.0;      ///< of one value about the mean, n - 1
  double sd_low = 0.0;  ///< the true standard deviation lies between these with 95 %
  double sd_high = 0.0;
  double predicted = 0.0;  ///< rms of the sigmas; 0 where none is known
  double ratio = 0.0;      ///< sd over predicted; 0 where that is 0
  double p = 1.0;          ///< probability of a ratio at least this far from 1 (two-sided) if the sigmas are true
};

/// Quantities of one kind, and whether their sigmas are true.
struct RepeatedGroup {
  std::string name;   ///< "points", "rim, radial", "PF", ...
  std::string about;  ///< what was done to compare the runs
  std::vector<RepeatedQuantity> quantities;
  double sd = 0.0;         ///< rms of those of the quantities
  double predicted = 0.0;  ///< the same of the predicted ones
  double ratio = 0.0;  ///< rms of deviation over sigma, freed of the mean: 1 where the sigmas are true; 0 where none is known
  double ratio_low = 0.0;  ///< the true ratio lies between these with 95 %
  double ratio_high = 0.0;
  double dof =
      0.0;         ///< degrees of freedom: runs less one for each quantity that is worth one of its own, correlation taken off
  double p = 1.0;  ///< probability of such a ratio, two-sided, if the sigmas are true
};

/// Results of the same thing, measured again and again.
struct Repeatability {
  std::string verb;  ///< that made the results
  std::vector<std::string> runs;
  std::vector<RepeatedGroup> groups;
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
