#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "bundle/detail/dot_group.h"
#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"

namespace crosstie::bundle::detail {

enum class DotFate;

/// Whether support by `more` dots settles a conflict against `fewer`: by two dots and by a quarter.
bool dominates(std::size_t more, std::size_t fewer);

/// Decides between groups that claim the same dots (see match_uncoded for the rules).
class GroupChoice {
 public:
  explicit GroupChoice(const DotScene& scene) : scene_(scene), claims_(scene.dots.size()) {}

  /// A pair of dots was tried: what could have made a group by chance.
  void count_test(int dot_a, int dot_b) { tests_.emplace_back(dot_a, dot_b); }
  /// Of groups that are the same target only the better supported one is kept.
  void add(DotGroup group);
  /// The groups that are accepted, with the dots that they keep; writes the fates of all dots.
  std::vector<DotGroup> decide(const Survey& survey, const State& state, std::vector<DotFate>& fates);

 private:
  enum class Owner { kNobody, kContested, kTaken };
  /// What the decision looks at in one round.
  struct Chance {
    double tests = 0.0;         ///< pairs of free dots that were tried
    double free_per_px2 = 0.0;  ///< free dots
  };

  [[nodiscard]] bool is_same_target(const DotGroup& a, const DotGroup& b) const;
  [[nodiscard]] std::vector<int> free_dots(const DotGroup& group) const;
  [[nodiscard]] std::vector<int> own_dots(std::size_t group) const;
  [[nodiscard]] bool is_seen_from_enough(const DotGroup& group, const std::vector<int>& dots) const;
  [[nodiscard]] bool is_no_chance(const DotGroup& group, const std::vector<int>& dots, const Chance& chance) const;
  [[nodiscard]] bool faces_its_cameras(const Survey& survey, const State& state, const DotGroup& group) const;
  [[nodiscard]] bool has_known_size(const DotGroup& group, const std::vector<DotGroup>& accepted) const;
  [[nodiscard]] Chance chance() const;

  const DotScene& scene_;
  std::vector<DotGroup> groups_;
  std::vector<char> alive_;
  std::vector<std::size_t> support_;      ///< free dots of each living group in this round
  std::vector<std::vector<int>> claims_;  ///< of each dot: the groups that hold it
  std::vector<Owner> owners_;
  std::vector<std::pair<int, int>> tests_;
};

}  // namespace crosstie::bundle::detail
