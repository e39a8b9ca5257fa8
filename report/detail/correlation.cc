#include "report/detail/correlation.h"

#include <cmath>

#include <fmt/format.h>

#include "report/detail/colour.h"
#include "report/detail/number.h"
#include "report/detail/svg.h"

namespace crosstie::report::detail {

Eigen::MatrixXd correlation_matrix(const Eigen::MatrixXd& covariance) {
  const Eigen::Index count = covariance.rows();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      const double size = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      if (std::isfinite(size) && size > 0.0) result(i, j) = covariance(i, j) / size;
    }
  }
  return result;
}

std::string correlation_map(const Eigen::MatrixXd& correlation, const std::vector<std::string>& names, const std::string& title,
                            double flagged) {
  constexpr double kCell_px = 34.0;
  constexpr double kMargin_px = 34.0;
  const auto count = static_cast<Eigen::Index>(names.size());
  const double size = kMargin_px + kCell_px * static_cast<double>(count);
  Svg svg(size + 30.0, size + 4.0, title, fmt::format("Correlations of {} parameters", names.size()));
  for (Eigen::Index i = 0; i < count; ++i) {
    const double y = kCell_px * static_cast<double>(i) + 4.0;
    const auto& name = names[static_cast<std::size_t>(i)];
    svg.text(kMargin_px - 6.0, y + 0.5 * kCell_px + 4.0, name, "end", "label");
    for (Eigen::Index j = 0; j < i; ++j) {
      const double x = kMargin_px + kCell_px * static_cast<double>(j);
      const double r = correlation(i, j);
      svg.rect(x + 1.0, y + 1.0, kCell_px - 2.0, kCell_px - 2.0, std::abs(r) > flagged ? "flagged" : "", diverging_colour(r),
               fmt::format("{} and {}: {}", name, names[static_cast<std::size_t>(j)], fixed(r, 3)));
      svg.text(x + 0.5 * kCell_px, y + 0.5 * kCell_px + 3.5, fixed(r, 2), "middle", "cell");
      if (std::abs(r) > flagged) svg.rect(x + 1.5, y + 1.5, kCell_px - 3.0, kCell_px - 3.0, "flag");
    }
    svg.text(kMargin_px + kCell_px * (static_cast<double>(i) + 0.5), y + 0.5 * kCell_px + 4.0, name, "middle", "label");
  }
  return svg.str();
}

}  // namespace crosstie::report::detail
