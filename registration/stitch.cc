#include "registration/stitch.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "base/parallel.h"
#include "math/cofactors.h"
#include "math/distributions.h"
#include "registration/detail/outcome.h"
#include "registration/segment.h"

namespace crosstie::registration {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kReach = 0.8;            // cells within which a partner lies when the poses are good
constexpr double kScanLeftWeight = 1e3;   // a scan's point lies on the ray of its left pixel
constexpr double kHeightSigmas = 6.0;     // of the last round's differences, within which partners are sought along the normal
constexpr double kNarrow = 0.5;           // by which the reach shrinks in each round
constexpr std::size_t kModePlaces = 200;  // points of each station by which the head's effect is judged
constexpr int kFreeRounds = 6;
constexpr int kMaxRejections = 200;

std::set<std::size_t> used_pieces(const detail::StitchWork& work, std::size_t station) {
  std::set<std::size_t> used;
  for (const detail::Overlap& overlap : work.overlaps) {
    if (overlap.a != static_cast<int>(station) && overlap.b != static_cast<int>(station)) continue;
    const bool first = overlap.a == static_cast<int>(station);
    for (const detail::Match& match : overlap.matches) used.insert(static_cast<std::size_t>(first ? match.a : match.b));
  }
  return used;
}

/// The head's effect on the pieces that are matched, where it is not known yet; then the distances as the present head has them.
Result<> apply_shared(detail::StitchWork& work, int threads) {
  if (!work.modes) return {};
  work.piece_by_shared.resize(work.input.stations.size());
  for (std::size_t k = 0; k < work.input.stations.size(); ++k) {
    const auto& surface = work.input.stations[k].surface;
    if (!surface) continue;
    Eigen::MatrixXf& known = work.piece_by_shared[k];
    if (known.size() == 0) {
      known = Eigen::MatrixXf::Constant(work.shared_size(), 3 * static_cast<Index>(surface->pieces().size()), std::nanf(""));
    }
    const std::set<std::size_t> used = used_pieces(work, k);
    const std::vector<std::size_t> pieces(used.begin(), used.end());
    auto done = base::parallel_for(pieces.size(), threads, "calibration", {}, [&](std::size_t i) -> Result<> {
      auto columns = known.middleCols<3>(3 * static_cast<Index>(pieces[i]));
      if (!std::isnan(columns(0, 0))) return {};
      columns = work.modes->point_by_modes(surface->pieces()[pieces[i]].point_mm, kScanLeftWeight).transpose().cast<float>();
      return {};
    });
    if (!done) return done;
  }
  for (detail::Overlap& overlap : work.overlaps) {
    const Eigen::VectorXd change = overlap_by_shared(work, overlap) * work.state.shared;
    for (std::size_t i = 0; i < overlap.matches.size(); ++i) overlap.matches[i].distance_mm += change(static_cast<Index>(i));
  }
  return {};
}

double cell_of(const StitchInput& input) {
  double cell = 0.0;
  for (const StationScan& station : input.stations) {
    if (station.surface) cell = std::max(cell, station.surface->cell_mm());
  }
  return cell;
}

/// All overlaps matched anew, or their pairs kept and only their distances taken again.
Result<> match_all(detail::StitchWork& work, double reach_mm, double height_mm, bool anew) {
  const auto& stations = work.input.stations;
  const StitchOptions& options = work.options;
  if (anew) {
    work.overlaps.clear();
    for (std::size_t a = 0; a < stations.size(); ++a) {
      for (std::size_t b = a + 1; b < stations.size(); ++b) {
        if (!stations[a].surface || !stations[b].surface) continue;
        const base::Pose& frame_from_a = work.state.machine_from_rig[a];
        const base::Pose& frame_from_b = work.state.machine_from_rig[b];
        if (!detail::may_overlap(*stations[a].surface, *stations[b].surface, frame_from_b.inverse() * frame_from_a, reach_mm))
          continue;
        // The finer one's pieces look for partners among the coarser one's only where the latter has more of them.
        auto matches = detail::find_matches(*stations[a].surface, *stations[b].surface, frame_from_a, frame_from_b,
                                            {reach_mm, height_mm, options.max_normal_rad}, options.threads);
        if (!matches) return tl::unexpected(matches.error());
        if (static_cast<int>(matches->size()) < options.least_matches) continue;
        detail::Overlap overlap;
        overlap.a = static_cast<int>(a);
        overlap.b = static_cast<int>(b);
        overlap.matches = *std::move(matches);
        work.overlaps.push_back(std::move(overlap));
      }
    }
  } else {
    for (detail::Overlap& overlap : work.overlaps) {
      const auto a = static_cast<std::size_t>(overlap.a);
      const auto b = static_cast<std::size_t>(overlap.b);
      detail::update_matches(*stations[a].surface, *stations[b].surface, work.state.machine_from_rig[a],
                             work.state.machine_from_rig[b], overlap.matches);
    }
  }
  if (auto applied = apply_shared(work, options.threads); !applied) return applied;
  detail::trust_matches(work.overlaps, work.scale);
  // Whether an excess is beyond chance may change from round to round; in the end it must not.
  const double share = detail::independent_share(work.overlaps, work.scale.factor, cell_of(work.input));
  work.scale.independent_share = work.rounds++ < kFreeRounds ? share : std::min(share, work.scale.independent_share);
  for (detail::Overlap& overlap : work.overlaps) detail::find_visible(overlap, options.least_seen, work.segment);
  return {};
}

/// Where a station's middle is and how far it reaches, in its rig.
struct Extent {
  Vector3d centre = Vector3d::Zero();
  double reach = 0.0;
};

Extent extent_of(const StationScan& station) {
  Extent extent;
  if (station.surface) {
    extent.centre = station.surface->centre_mm();
    extent.reach = 0.5 * (station.surface->most_mm() - station.surface->least_mm()).norm();
    return extent;
  }
  for (const Sighting& sighting : station.markers)
    extent.centre += sighting.p_in_rig_mm / static_cast<double>(station.markers.size());
  for (const Sighting& sighting : station.markers)
    extent.reach = std::max(extent.reach, (sighting.p_in_rig_mm - extent.centre).norm());
  return extent;
}

/// Largest move of a place of any station between two states.
double largest_move(const StitchInput& input, const std::vector<base::Pose>& before, const std::vector<base::Pose>& after) {
  double largest = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    const Extent extent = extent_of(input.stations[k]);
    const double shift = (after[k] * extent.centre - before[k] * extent.centre).norm();
    const double turn = base::rotation_log(after[k].rotation * before[k].rotation.conjugate()).norm();
    largest = std::max({largest, shift, turn * extent.reach});
  }
  return largest;
}

/// One step of Gauss-Newton at the present matches.
Result<detail::StitchSolution> step(detail::StitchWork& work, bool move) {
  auto model = detail::build_model(work);
  if (!model) return fail(std::move(model));
  math::WhitenedRows rows;
  if (!model->model.linearise(rows)) return fail(ErrorCode::kInternal, "stitch: an observation cannot be predicted");
  const math::Parameters parameters = model->model.parameters();
  auto equations = math::NormalEquations::make(parameters, rows, MatrixXd(parameters.size(), 0));
  if (!equations) {
    if (equations.error().code == ErrorCode::kNoUniqueSolution) return tl::unexpected(detail::explain_free(work, *model));
    return fail(std::move(equations));
  }
  if (move) {
    model->model.move(equations->step());
    detail::read_back(*model, work.state);
  }
  return detail::StitchSolution{*std::move(model), std::move(rows), *std::move(equations)};
}

/// The most doubtful sighting or place of the list, if no chance explains it.
bool reject_worst(detail::StitchWork& work, const detail::StitchSolution& at) {
  const std::vector<MatrixXd> cofactors = math::residual_cofactors(at.equations, at.rows);
  struct Suspect {
    int station = -1;
    int index = -1;
    double w = 0.0;
    double distance = 0.0;
  } worst;
  int count = 0;
  const auto judge = [&](int station, int index, double w, double distance) {
    ++count;
    if (w > worst.w) worst = {station, index, w, distance};
  };
  for (std::size_t g = 0; g < at.model.groups.size(); ++g) {
    const detail::StitchGroup& group = at.model.groups[g];
    const Eigen::VectorXd residual = at.rows.residual(static_cast<int>(g));
    if (group.source == detail::Source::kMarkers) {
      const auto& cov =
          work.input.stations[static_cast<std::size_t>(group.station)].markers[static_cast<std::size_t>(group.index)].cov_mm2;
      judge(group.station, group.index, detail::standardised(residual, cofactors[g]), (cov.llt().matrixL() * residual).norm());
    } else if (group.source == detail::Source::kReference && group.index >= 0) {
      const auto row = 3 * static_cast<Index>(group.index);
      const Eigen::Matrix3d cov = work.input.reference->points.cov_mm2.block<3, 3>(row, row);
      judge(-1, group.index, detail::standardised(residual, cofactors[g]), std::sqrt(cov.trace() / 3.0) * residual.norm());
    } else if (group.source == detail::Source::kReference) {
      const auto back = at.model.listed_whitening.fullPivLu();
      const Eigen::VectorXd off = back.solve(residual);
      const MatrixXd cov = back.solve(MatrixXd(back.solve(cofactors[g]).transpose()));
      for (std::size_t i = 0; i < at.model.listed_in_one_group.size(); ++i) {
        const auto row = 3 * static_cast<Index>(i);
        const int index = at.model.listed_in_one_group[i];
        const MatrixXd prior =
            work.input.reference->points.cov_mm2.block<3, 3>(3 * static_cast<Index>(index), 3 * static_cast<Index>(index));
        judge(-1, index, detail::standardised(off.segment<3>(row), cov.block<3, 3>(row, row), prior),
              off.segment<3>(row).norm());
      }
    }
  }
  if (count == 0) return false;
  const double limit = std::sqrt(math::chi_square_quantile(1.0 - work.options.rejection_significance / count, 3.0) / 3.0);
  if (worst.w <= limit) return false;
  base::RejectedSighting& rejected = work.rejected.emplace_back();
  rejected.station = worst.station;
  rejected.w = worst.w;
  rejected.distance_mm = worst.distance;
  const auto index = static_cast<std::size_t>(worst.index);
  if (worst.station >= 0) {
    const auto station = static_cast<std::size_t>(worst.station);
    work.active[station][index] = false;
    rejected.id = work.input.stations[station].markers[index].id;
    rejected.reason =
        fmt::format("its residual of {:.3f} mm is {:.1f} times what the sigmas allow: the marker moved, or was badly seen",
                    worst.distance, worst.w);
  } else {
    work.listed[index] = false;
    rejected.id = work.input.reference->points.ids[index];
    rejected.reason = fmt::format(
        "its place in the list is {:.3f} mm off, {:.1f} times what the sigmas allow: it was moved or badly measured",
        worst.distance, worst.w);
  }
  return true;
}

Result<> check_input(const StitchInput& input) {
  const auto bad = [](std::string message) { return fail(ErrorCode::kBadInput, std::move(message)); };
  const bool has_frame = input.commissioned && input.commissioned->frame.cov.size() > 0;
  if (!has_frame &&
      std::any_of(input.stations.begin(), input.stations.end(), [](const auto& s) { return s.axis_mm.has_value(); })) {
    return fail(ErrorCode::kUsage, "a station brings a reading of the axis, but there is no commissioned frame");
  }
  if (input.stations.empty()) return bad("stitch needs a station");
  if (input.stations.size() == 1 && !has_frame && !input.reference) {
    return bad("a single station has nothing to be stitched to: neither another one nor an axis nor a list of markers");
  }
  std::set<std::string> names;
  for (const StationScan& station : input.stations) {
    if (!names.insert(station.name).second) return bad(fmt::format("station '{}' comes twice", station.name));
    std::set<int> ids;
    for (const Sighting& sighting : station.markers) {
      if (!ids.insert(sighting.id).second)
        return bad(fmt::format("station '{}' has marker {} twice", station.name, sighting.id));
      if (!sighting.p_in_rig_mm.allFinite() || !sighting.cov_mm2.allFinite()) {
        return bad(fmt::format("station '{}': marker {} is not finite", station.name, sighting.id));
      }
    }
    if (station.markers.empty() && !station.surface) {
      return bad(fmt::format("station '{}' has neither markers nor a surface", station.name));
    }
  }
  if (input.reference) {
    const base::ControlGroup& points = input.reference->points;
    const auto size = 3 * static_cast<Index>(points.ids.size());
    if (points.xyz_mm.size() != size || points.cov_mm2.rows() != size || points.cov_mm2.cols() != size ||
        !points.xyz_mm.allFinite() || !points.cov_mm2.allFinite()) {
      return bad("the list of reference coordinates and its covariance do not fit each other");
    }
    std::set<int> ids(points.ids.begin(), points.ids.end());
    if (ids.size() != points.ids.size()) return bad("the list of reference coordinates has an id twice");
  }
  return {};
}

/// The same scan under two names would count its noise twice.
Result<> check_duplicates(const StitchInput& input) {
  for (std::size_t a = 0; a < input.stations.size(); ++a) {
    for (std::size_t b = a + 1; b < input.stations.size(); ++b) {
      const StationScan& first = input.stations[a];
      const StationScan& second = input.stations[b];
      bool same = first.surface && second.surface && first.surface->fingerprint() == second.surface->fingerprint();
      if (first.markers.size() >= 3 && first.markers.size() == second.markers.size()) {
        same = same || std::equal(first.markers.begin(), first.markers.end(), second.markers.begin(),
                                  [](const auto& p, const auto& q) { return p.id == q.id && p.p_in_rig_mm == q.p_in_rig_mm; });
      }
      if (same) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("stations '{}' and '{}' hold the same scan: one of them is a copy", first.name, second.name));
      }
    }
  }
  return {};
}

void place_markers(detail::StitchWork& work) {
  std::map<int, std::pair<Vector3d, int>> sums;
  for (std::size_t k = 0; k < work.input.stations.size(); ++k) {
    for (std::size_t i = 0; i < work.active[k].size(); ++i) {
      if (!work.active[k][i]) continue;
      const Sighting& sighting = work.input.stations[k].markers[i];
      auto& [sum, count] = sums.try_emplace(sighting.id, Vector3d::Zero(), 0).first->second;
      sum += work.state.machine_from_rig[k] * sighting.p_in_rig_mm;
      ++count;
    }
  }
  for (const auto& [id, sum] : sums) work.state.markers[id] = sum.first / sum.second;
}

base::Segment segment_of(const StitchInput& input, const std::vector<base::Pose>& poses, int threads) {
  constexpr std::size_t kEach = 400;
  std::vector<Vector3d> points;
  for (std::size_t k = 0; k < input.stations.size(); ++k) {
    if (!input.stations[k].surface) continue;
    const auto& pieces = input.stations[k].surface->pieces();
    const std::size_t every = std::max<std::size_t>(1, pieces.size() / kEach);
    for (std::size_t i = 0; i < pieces.size(); i += every) points.push_back(poses[k] * pieces[i].point_mm);
  }
  return fit_segment(points, threads);
}

/// Points of all stations at which the head's effect is judged.
std::vector<Vector3d> places_of(const StitchInput& input) {
  std::vector<Vector3d> places;
  for (const StationScan& station : input.stations) {
    for (const Sighting& sighting : station.markers) places.push_back(sighting.p_in_rig_mm);
    if (!station.surface) continue;
    const auto& pieces = station.surface->pieces();
    const std::size_t every = std::max<std::size_t>(1, pieces.size() / kModePlaces);
    for (std::size_t i = 0; i < pieces.size(); i += every) places.push_back(pieces[i].point_mm);
  }
  return places;
}

}  // namespace

CommissionedHead CommissionedHead::calibrated(const base::Head& head) { return {head, {}, head.cov}; }

Result<CommissionedHead> CommissionedHead::of(const base::Commissioning& commissioning) {
  CommissionedHead result{commissioning.head, commissioning.frame, {}};
  std::vector<std::string> wanted;
  for (const auto& [name, camera] :
       {std::pair(&result.head.left_name, &result.head.left), std::pair(&result.head.right_name, &result.head.right)}) {
    for (const std::string_view parameter : base::parameter_names(camera->model()))
      wanted.push_back(fmt::format("camera {} {}", *name, parameter));
  }
  constexpr const char* kParts[] = {"rx", "ry", "rz", "tx", "ty", "tz"};
  for (const char* part : kParts) wanted.push_back(fmt::format("rig {}", part));
  for (const char* part : kParts) wanted.push_back(fmt::format("head {}", part));
  for (const char* part : {"across 1", "across 2", "scale"}) wanted.push_back(fmt::format("axis {}", part));
  for (const base::ErrorMotion& term : result.frame.axis.terms) {
    if (term.in_frame) wanted.push_back(fmt::format("axis {}{}", term.name, term.order));
  }
  const auto size = static_cast<Index>(wanted.size());
  if (size != result.head.parameter_count() + result.frame.cov.rows()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the commissioning's frame has {} parameters with a covariance; {} are expected",
                            result.frame.cov.rows(), size - result.head.parameter_count()));
  }
  // Parameters that were held stand in no covariance.
  std::vector<Index> from, to;
  for (Index i = 0; i < size; ++i) {
    const auto& name = wanted[static_cast<std::size_t>(i)];
    const auto label = std::find_if(commissioning.labels.begin(), commissioning.labels.end(),
                                    [&](const std::string& l) { return l == name || l.starts_with(name + " ["); });
    if (label == commissioning.labels.end()) continue;
    from.push_back(label - commissioning.labels.begin());
    to.push_back(i);
  }
  if (commissioning.covariance.rows() != static_cast<Index>(commissioning.labels.size()) ||
      commissioning.covariance.cols() != commissioning.covariance.rows()) {
    return fail(ErrorCode::kBadInput, "the commissioning's covariance and its labels do not fit each other");
  }
  result.cov = MatrixXd::Zero(size, size);
  result.cov(to, to) = commissioning.covariance(from, from);
  // What stands in the frame's own covariance but under no label would be taken for exact.
  const Index frame = result.frame.cov.rows();
  const MatrixXd own = result.cov.bottomRightCorner(frame, frame);
  const Eigen::ArrayXd stated = result.frame.cov.diagonal().array();
  if (((own.diagonal().array() - stated).abs() > 1e-6 * stated).any()) {
    return fail(ErrorCode::kBadInput, "the commissioning's joint covariance is not that of its frame");
  }
  return result;
}

Result<> StitchOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "stitch options: " + what); };
  if (max_iterations < 1) return bad("max_iterations must be positive");
  if (!(converged_mm > 0.0)) return bad("converged_mm must be positive");
  if (!(max_normal_rad > 0.0 && max_normal_rad < 1.6)) return bad("max_normal_rad lies between 0 and 1.6");
  if (start_reach_mm && !(*start_reach_mm > 0.0)) return bad("start_reach_mm must be positive");
  if (least_matches < 6) return bad("least_matches is at least 6");
  if (!(least_seen >= 0.0 && least_seen < 1.0)) return bad("least_seen lies between 0 and 1");
  if (!(rejection_significance > 0.0 && rejection_significance < 0.5))
    return bad("levels of significance lie between 0 and 0.5");
  if (!(marker_tolerance_mm >= 0.0)) return bad("marker_tolerance_mm must not be negative");
  return {};
}

Result<base::Stitching> stitch(const StitchInput& input, const StitchOptions& options, const base::Progress& progress) {
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  if (auto valid = check_input(input); !valid) return fail(std::move(valid));
  if (auto valid = check_duplicates(input); !valid) return fail(std::move(valid));
  detail::StitchWork work{input, options};
  if (input.commissioned) {
    auto modes = detail::SharedModes::make(*input.commissioned, places_of(input));
    if (!modes) return fail(std::move(modes));
    work.modes = *std::move(modes);
    work.state.shared = Eigen::VectorXd::Zero(work.modes->size());
  }
  auto start = detail::find_start(input, options);
  if (!start) return fail(std::move(start));
  work.state.machine_from_rig = start->machine_from_rig;
  work.state.machine_from_part = start->machine_from_part;
  work.state.datum_is_first = start->datum_is_first;
  work.active = start->active;
  work.listed = start->listed;
  work.rejected = start->rejected;
  place_markers(work);
  work.segment = input.segment ? *input.segment : segment_of(input, work.state.machine_from_rig, options.threads);

  const double cell = cell_of(input);
  const double near = kReach * cell;
  double reach = options.start_reach_mm ? *options.start_reach_mm : std::max(near, 3.0 * start->sigma_mm);
  double height = reach;
  std::vector<base::StitchIteration> iterations;
  bool settled = false;
  for (int rejections = 0;;) {
    if (progress.cancelled()) return base::cancelled("stitch");
    progress("matching (ICP)", iterations.size(), static_cast<std::size_t>(options.max_iterations));
    if (auto matched = match_all(work, reach, height, !settled); !matched) return fail(std::move(matched));
    const std::vector<base::Pose> before = work.state.machine_from_rig;
    auto solution = step(work, true);
    if (!solution) return fail(std::move(solution));
    const double moved = largest_move(input, before, work.state.machine_from_rig);
    base::StitchIteration& iteration = iterations.emplace_back();
    for (const detail::Overlap& overlap : work.overlaps) iteration.matches += static_cast<int>(overlap.matches.size());
    iteration.moved_mm = moved;
    iteration.rms_mm = work.scale.rms_mm;
    const bool wide = reach > near;
    reach = std::max(near, kNarrow * reach);
    height = std::clamp(kHeightSigmas * work.scale.rms_mm, 1e-3 * cell, reach);
    // Pairs that change back and forth would never end: after that many rounds they stay.
    const bool last = static_cast<int>(iterations.size()) >= options.max_iterations;
    if (moved > options.converged_mm || wide) {
      settled = settled || last;
      if (static_cast<int>(iterations.size()) < 2 * options.max_iterations) continue;
    }
    if (auto matched = match_all(work, reach, height, false); !matched) return fail(std::move(matched));
    auto final = step(work, false);
    if (!final) return fail(std::move(final));
    if (rejections < kMaxRejections && reject_worst(work, *final)) {
      ++rejections;
      settled = false;
      continue;
    }
    return detail::outcome(work, *final, std::move(iterations));
  }
}

}  // namespace crosstie::registration
