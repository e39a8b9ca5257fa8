#include "app/point_covariance.h"

#include <fmt/core.h>

#include "base/file.h"
#include "base/npy.h"

namespace crosstie::app {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

Result<Eigen::MatrixXd> point_covariance(const fs::path& result, std::size_t point_count) {
  const fs::path file = result.parent_path() / "covariance.npy";
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return Eigen::MatrixXd();
  auto full = base::read_npy(file);
  if (!full) return full;
  const auto size = static_cast<Eigen::Index>(3 * point_count);
  if (full->rows() != full->cols() || full->rows() < size) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}: {} x {} is not the covariance of {} points", base::shown(file),
                                                        full->rows(), full->cols(), point_count));
  }
  return full->bottomRightCorner(size, size).eval();
}

}  // namespace crosstie::app
