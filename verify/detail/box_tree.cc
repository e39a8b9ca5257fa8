#include "verify/detail/box_tree.h"

#include <algorithm>
#include <numeric>

namespace crosstie::verify::detail {
namespace {

constexpr std::uint32_t kLeaf = 8;

}  // namespace

BoxTree::BoxTree(const std::vector<Box>& boxes) {
  order_.resize(boxes.size());
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.reserve(boxes.size() / 2 + 2);
  if (!boxes.empty()) build(boxes, 0, static_cast<std::uint32_t>(boxes.size()));
}

std::uint32_t BoxTree::build(const std::vector<Box>& boxes, std::uint32_t first, std::uint32_t last) {
  const auto at = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Box box;
  Box centres;
  for (std::uint32_t i = first; i < last; ++i) {
    const Box& one = boxes[order_[i]];
    box.add(one.low);
    box.add(one.high);
    centres.add(0.5 * (one.low + one.high));
  }
  nodes_[at].box = box;
  nodes_[at].first = first;
  nodes_[at].last = last;
  if (last - first <= kLeaf) return at;
  Eigen::Index axis = 0;
  (centres.high - centres.low).maxCoeff(&axis);
  const std::uint32_t middle = first + (last - first) / 2;
  const auto centre = [&](std::uint32_t i) { return boxes[i].low(axis) + boxes[i].high(axis); };
  std::nth_element(
      order_.begin() + first, order_.begin() + middle, order_.begin() + last,
      [&](std::uint32_t a, std::uint32_t b) { return centre(a) < centre(b) || (centre(a) == centre(b) && a < b); });
  build(boxes, first, middle);
  const std::uint32_t right = build(boxes, middle, last);
  nodes_[at].right = right;
  return at;
}

std::vector<BoxTree::Hit> BoxTree::nearest(const Eigen::Vector3d& p, std::size_t count, double limit,
                                           const std::function<double(std::size_t)>& square) const {
  std::vector<Hit> best;  // a heap, the farthest first
  const auto nearer = [](const Hit& a, const Hit& b) {
    return a.square < b.square || (a.square == b.square && a.index < b.index);
  };
  const auto bound = [&] { return best.size() < count ? limit : best.front().square; };
  std::vector<std::pair<double, std::uint32_t>> open;
  if (!nodes_.empty()) open.emplace_back(nodes_[0].box.square_distance(p), 0U);
  while (!open.empty()) {
    const auto [distance, at] = open.back();
    open.pop_back();
    if (distance > bound()) continue;
    const Node& node = nodes_[at];
    if (node.right != 0) {
      const std::uint32_t left = at + 1;
      const double a = nodes_[left].box.square_distance(p);
      const double b = nodes_[node.right].box.square_distance(p);
      if (a < b) {  // the nearer one last: it comes first
        open.emplace_back(b, node.right);
        open.emplace_back(a, left);
      } else {
        open.emplace_back(a, left);
        open.emplace_back(b, node.right);
      }
      continue;
    }
    for (std::uint32_t i = node.first; i < node.last; ++i) {
      const Hit hit{order_[i], square(order_[i])};
      if (!(hit.square < limit)) continue;
      if (best.size() == count) {
        if (!nearer(hit, best.front())) continue;
        std::pop_heap(best.begin(), best.end(), nearer);
        best.pop_back();
      }
      best.push_back(hit);
      std::push_heap(best.begin(), best.end(), nearer);
    }
  }
  std::sort_heap(best.begin(), best.end(), nearer);
  return best;
}

}  // namespace crosstie::verify::detail
