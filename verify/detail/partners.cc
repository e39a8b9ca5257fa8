#include "verify/detail/partners.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

namespace crosstie::verify::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::PointList;
using base::ReferencePoint;
using base::Result;

Result<std::map<int, std::size_t>> index_by_id(const PointList& list, const char* name) {
  std::map<int, std::size_t> index;
  for (std::size_t i = 0; i < list.points.size(); ++i) {
    const ReferencePoint& point = list.points[i];
    if (!point.xyz_mm.allFinite() || (point.cov_mm2 && !point.cov_mm2->allFinite())) {
      return fail(ErrorCode::kBadInput, fmt::format("{} point {}: a coordinate or covariance is not finite", name, point.id));
    }
    if (!index.emplace(point.id, i).second) {
      return fail(ErrorCode::kBadInput, fmt::format("{} points: id {} stands there twice; keep one of them", name, point.id));
    }
  }
  return index;
}

std::string id_range(const PointList& list) {
  if (list.points.empty()) return "no point";
  const auto [low, high] =
      std::minmax_element(list.points.begin(), list.points.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return fmt::format("{} points, ids {} to {}", list.points.size(), low->id, high->id);
}

}  // namespace

std::vector<math::AlignmentPair> Partners::used_pairs() const {
  std::vector<math::AlignmentPair> result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (used[i]) result.push_back(pairs[i]);
  }
  return result;
}

Result<Partners> match_by_id(const PointList& measured, const PointList& reference, std::span<const int> exclude_ids) {
  auto measured_index = index_by_id(measured, "measured");
  if (!measured_index) return fail(std::move(measured_index));
  auto reference_index = index_by_id(reference, "reference");
  if (!reference_index) return fail(std::move(reference_index));

  Partners partners;
  for (const auto& [id, m] : *measured_index) {
    const auto r = reference_index->find(id);
    if (r == reference_index->end()) {
      partners.only_measured.push_back(id);
      continue;
    }
    const ReferencePoint& in_measured = measured.points[m];
    const ReferencePoint& in_reference = reference.points[r->second];
    const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
    partners.ids.push_back(id);
    partners.pairs.push_back(
        {in_reference.xyz_mm, in_measured.xyz_mm, in_reference.cov_mm2.value_or(zero), in_measured.cov_mm2.value_or(zero)});
    partners.measured_index.push_back(m);
    partners.has_covariance.push_back(in_reference.cov_mm2.has_value() || in_measured.cov_mm2.has_value());
    partners.used.push_back(std::find(exclude_ids.begin(), exclude_ids.end(), id) == exclude_ids.end());
  }
  for (const auto& [id, r] : *reference_index) {
    if (!measured_index->contains(id)) partners.only_reference.push_back(id);
  }
  if (std::find(partners.used.begin(), partners.used.end(), true) == partners.used.end()) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("no point of the measurement ({}) has a partner in the reference ({}){}; are they lists of the same "
                    "object, and do they number its points alike?",
                    id_range(measured), id_range(reference), partners.ids.empty() ? "" : " that is not excluded"));
  }
  return partners;
}

}  // namespace crosstie::verify::detail
