#pragma once

#include <vector>

#include "base/network.h"
#include "base/progress.h"
#include "base/result.h"
#include "bundle/adjust.h"
#include "bundle/detail/dot_group.h"
#include "bundle/detail/outliers.h"

namespace crosstie::bundle::detail {

/// What became of a dot.
enum class DotFate {
  kHasId,      ///< a coded marker: not looked at here
  kUnmatched,  ///< no place on which three images agree: glare, screws, targets seen too rarely
  kAmbiguous,  ///< belongs to one of several groups, and nothing says to which
  kMatched,
};

/// Dots of a network that were told to be images of the same uncoded targets.
struct UncodedMatches {
  std::vector<Dot> dots;
  std::vector<DotFate> fates;     ///< of each dot
  std::vector<DotGroup> targets;  ///< in the order of their ids
};

/// Matches the uncoded dots of all images by their places, given the orientation that the coded markers gave.
///
/// Seeds: each dot that no clear group holds yet is followed along its epipolar curves into a few partner images; each dot there
/// whose ray meets the seed's (chi-square with the covariances of both) and whose size fits gives a place, which is predicted
/// into all other images and grown (grow() in dot_group.h). All groups are kept, rivals included.
///
/// Decision: the best supported groups first, and only dots count that no rival claims with comparable support, so that what two
/// groups could both explain is left out rather than guessed. A group is accepted if
///   - it is seen from three directions that are 5 degrees apart or more. Two never suffice: a pair of rays has one condition
///     only, which a wrong pair fulfils by chance; and images from one place confirm each other whatever the depth;
///   - the number of such groups to be expected in this network by pure chance is below 1e-3: tests * C(v - 2, s - 2) p^(s - 2)
///     with s of its v images agreeing and p the chance of some free dot in a gate (a contrario; Desolneux, Moisan & Morel,
///     Int. J. Computer Vision 40(1), 2000). Networks of many images full of spurious dots so ask for more than three;
///   - the circle that its ellipses determine, where they do, faces all of its cameras;
///   - its size, where fewer than five dots support it, is that of a better supported target.
///
/// Near linear: a curve meets few dots of the partner's grid, and what a group holds needs no seed of its own.
UncodedMatches match_uncoded(const base::Network& network, const Survey& survey, const State& state, const Estimate& at,
                             const Weights& weights, const AdjustOptions& options, const base::Progress& progress);

/// The targets become points of the survey with ids from first_uncoded_id() on, their dots become rays; lists indexed by point or
/// ray are brought along.
void enter_uncoded(const UncodedMatches& matches, Survey& survey, State& state, Weights& weights, Reasons& reasons);

/// The state with the coded points only: what the frame of the network is taken from, so that it does not depend on what dots
/// were matched.
State coded_only(const Survey& survey, State state);

/// For AdjustedNetwork::uncoded.
base::UncodedDots summary(const UncodedMatches& matches, const Survey& survey);

/// 1001 (coded ids end at 1000 in ScanReference's numbering), or one past the next thousand above the largest coded id where that
/// is greater.
int first_uncoded_id(int largest_coded_id);

}  // namespace crosstie::bundle::detail
