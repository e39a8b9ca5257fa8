#include "verify/detail/partners.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

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

void add(const PointList& measured, std::size_t m, const ReferencePoint& in_reference, bool used, Partners& partners) {
  const ReferencePoint& in_measured = measured.points[m];
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  partners.ids.push_back(in_measured.id);
  partners.reference_ids.push_back(in_reference.id);
  partners.pairs.push_back(
      {in_reference.xyz_mm, in_measured.xyz_mm, in_reference.cov_mm2.value_or(zero), in_measured.cov_mm2.value_or(zero)});
  partners.measured_index.push_back(m);
  partners.has_covariance.push_back(in_reference.cov_mm2.has_value() || in_measured.cov_mm2.has_value());
  partners.used.push_back(used);
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
    if (!measured.points[m].has_own_id) continue;
    const auto r = reference_index->find(id);
    if (r == reference_index->end()) {
      partners.only_measured.push_back(id);
      continue;
    }
    const bool used = std::find(exclude_ids.begin(), exclude_ids.end(), id) == exclude_ids.end();
    add(measured, m, reference.points[r->second], used, partners);
  }
  for (const auto& [id, r] : *reference_index) {
    const auto m = measured_index->find(id);
    if (m == measured_index->end() || !measured.points[m->second].has_own_id) partners.only_reference.push_back(id);
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

std::vector<int> add_by_position(const PointList& measured, const PointList& reference,
                                 const base::Pose& reference_from_measured, double scale, double gate_mm, Partners& partners) {
  std::vector<std::size_t> points;  // measured, without an id of their own
  for (std::size_t m = 0; m < measured.points.size(); ++m) {
    if (!measured.points[m].has_own_id) points.push_back(m);
  }
  std::vector<std::tuple<double, std::size_t, int>> near;  // distance, measured, id in the reference
  for (const std::size_t m : points) {
    const Eigen::Vector3d place =
        scale * (reference_from_measured.rotation * measured.points[m].xyz_mm) + reference_from_measured.translation_mm;
    for (const int id : partners.only_reference) {
      const double distance = (reference.find(id)->xyz_mm - place).norm();
      if (distance < gate_mm) near.emplace_back(distance, m, id);
    }
  }
  std::sort(near.begin(), near.end());
  std::map<std::size_t, int> partner_of;
  std::set<int> taken;
  for (const auto& [distance, m, id] : near) {
    if (partner_of.contains(m) || taken.contains(id)) continue;
    partner_of[m] = id;
    taken.insert(id);
  }
  std::vector<int> unpaired;
  for (const std::size_t m : points) {
    const auto partner = partner_of.find(m);
    if (partner == partner_of.end()) {
      unpaired.push_back(measured.points[m].id);
    } else {
      add(measured, m, *reference.find(partner->second), false, partners);
    }
  }
  std::erase_if(partners.only_reference, [&](int id) { return taken.contains(id); });
  std::sort(unpaired.begin(), unpaired.end());
  return unpaired;
}

}  // namespace crosstie::verify::detail
