#include "math/whitened_rows.h"

#include <cassert>

namespace crosstie::math {

int WhitenedRows::add(int rows, std::span<const int> blocks, std::span<const int> sizes) {
  assert(blocks.size() == sizes.size());
  groups_.push_back({rows, residuals_.size(), terms_.size(), blocks.size()});
  residuals_.resize(residuals_.size() + static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    terms_.push_back({blocks[i], sizes[i], values_.size()});
    values_.resize(values_.size() + static_cast<std::size_t>(rows * sizes[i]));
  }
  return group_count() - 1;
}

std::span<const WhitenedRows::Term> WhitenedRows::terms(int group_index) const {
  const Group& of = group(group_index);
  return {terms_.data() + of.first_term, of.term_count};
}

Eigen::Map<Eigen::VectorXd> WhitenedRows::residual(int group_index) {
  const Group& of = group(group_index);
  return {residuals_.data() + of.first_residual, of.rows};
}

Eigen::Map<const Eigen::VectorXd> WhitenedRows::residual(int group_index) const {
  const Group& of = group(group_index);
  return {residuals_.data() + of.first_residual, of.rows};
}

Eigen::Map<WhitenedRows::Matrix> WhitenedRows::jacobian(int group_index, std::size_t term) {
  const Term& of = terms(group_index)[term];
  return {values_.data() + of.values, group(group_index).rows, of.size};
}

Eigen::Map<const WhitenedRows::Matrix> WhitenedRows::jacobian(int group_index, std::size_t term) const {
  const Term& of = terms(group_index)[term];
  return {values_.data() + of.values, group(group_index).rows, of.size};
}

double WhitenedRows::square_sum() const {
  return Eigen::Map<const Eigen::VectorXd>(residuals_.data(), static_cast<Eigen::Index>(residuals_.size())).squaredNorm();
}

}  // namespace crosstie::math
