#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace crosstie::verify::detail {

/// A box that holds something.
struct Box {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(HUGE_VAL);
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-HUGE_VAL);

  void add(const Eigen::Vector3d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  [[nodiscard]] double square_distance(const Eigen::Vector3d& p) const {
    return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
  }
};

/// A tree of boxes over points or triangles, split at the median of the longest side: nearest ones in logarithmic time.
class BoxTree {
 public:
  explicit BoxTree(const std::vector<Box>& boxes);

  struct Hit {
    std::size_t index = 0;
    double square = 0.0;
  };
  /// The `count` things of least square distance, below `limit`, by distance; `square(i)` is that of thing i.
  [[nodiscard]] std::vector<Hit> nearest(const Eigen::Vector3d& p, std::size_t count, double limit,
                                         const std::function<double(std::size_t)>& square) const;

 private:
  struct Node {
    Box box;
    std::uint32_t first = 0;  ///< into order_
    std::uint32_t last = 0;   ///< one past it
    std::uint32_t right = 0;  ///< second child; the first one follows its parent. 0: a leaf
  };
  std::uint32_t build(const std::vector<Box>& boxes, std::uint32_t first, std::uint32_t last);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace crosstie::verify::detail
