#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "base/edge_curve.h"
#include "edge/detail/nominal_problem.h"
#include "edge/nominal_fit.h"

namespace crosstie::edge::detail {

/// The points of a rim that are kept, with what they share; arc lengths stay those of the whole rim.
[[nodiscard]] base::EdgeCurve part_of(const base::EdgeCurve& edge, const std::vector<char>& keep);

/// The nominal that fits some points of the rim.
struct PartFit {
  NominalState state;
  double square_sum = 0.0;  ///< v'Pv
  long redundancy = 0;
};
/// Nothing where the points do not determine it.
using FitPart = std::function<std::optional<PartFit>(const base::EdgeCurve& part)>;

/// A rim without the stretches that do not belong to its nominal.
struct SplitRim {
  std::vector<char> keep;  ///< of each point
  std::vector<ForeignStretch> stretches;
};

/// Stretches of a rim that lie off the nominal which the rest of it follows.
///
/// Such a stretch pulls a fit to all points towards itself, most of all at the end of an arc, and its own deviations then look like the others'. So
/// the nominal is first fitted to three quarters of the points: those nearest to it, by least trimmed squares of u with concentration steps
/// (Rousseeuw and Van Driessen, Computing LTS regression for large data sets, 2006), from starts of which each leaves out another quarter in one
/// piece, since what is foreign comes in pieces. Then all points are judged by what the kept ones scatter, their own sigmas and the rim's
/// form together, and the fit and the judgement are repeated until they stay.
/// Two neighbours or more that lie off to the same side beyond 3.29 sigmas may be a stretch; it reaches as far as its points lie beyond 1.96. Points
/// alone stay: the neighbours have told of them already.
/// It is one if the fit without it is better than that with it by more than chance: (v'Pv - v'Pv without) / (its rows) over v'Pv without / redundancy is
/// distributed as Fisher's F (with as many degrees of freedom as there are points that do not deviate together: in a form of its own neighbours do, as the correlations of u along the rim tell), and the largest of all stretches that could have been chosen passes the limit once in a hundred rims.
/// Nothing: there is none, or more than a quarter of the points would go, and then it is the nominal that is another one.
[[nodiscard]] std::optional<SplitRim> without_foreign_stretches(const base::EdgeCurve& edge, const Nominal& nominal,
                                                                const FitPart& fit_part);

}  // namespace crosstie::edge::detail
