#include "bundle/detail/survey_knowns.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "math/prior.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

}  // namespace

Result<> add_bars(const base::Network& network, Survey& survey) {
  int defining = 0;
  int used = 0;
  for (const base::ScaleBar& bar : network.scale_bars) {
    const std::string name = fmt::format("scale bar {}-{}", bar.id_a, bar.id_b);
    if (bar.id_a == bar.id_b) return fail(ErrorCode::kBadInput, name + " has the same point at both ends");
    if (!(bar.length_mm > 0.0) || !std::isfinite(bar.length_at_temperature_mm())) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: a length of {} mm is not possible", name, bar.length_mm));
    }
    const bool is_used = bar.role == base::ScaleBarRole::kUsed;
    if (!std::isfinite(bar.sigma_mm) || bar.sigma_mm < 0.0 || (is_used && bar.sigma_mm == 0.0)) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: a used bar needs a positive sigma, not {} mm", name, bar.sigma_mm));
    }
    const int a = survey.point_of(bar.id_a);
    const int b = survey.point_of(bar.id_b);
    if (a < 0 || b < 0) {
      survey.warnings.push_back({"bar_not_seen", name, name + " is not measured: an end of it is seen in no image"});
      continue;
    }
    defining += bar.role == base::ScaleBarRole::kDefines ? 1 : 0;
    used += is_used ? 1 : 0;
    survey.bars.push_back({a, b, bar});
  }
  std::stable_sort(survey.bars.begin(), survey.bars.end(), [](const Bar& x, const Bar& y) {
    return std::tie(x.bar.id_a, x.bar.id_b) < std::tie(y.bar.id_a, y.bar.id_b);
  });
  if (defining > 1 || (defining == 1 && used > 0)) {
    return fail(ErrorCode::kBadInput,
                "more than one length defines the scale; let one define it, or give each a sigma and the role used");
  }
  survey.scale_is_free = network.scale_is_free;
  std::size_t controlled = 0;
  for (const Control& control : survey.control) controlled += control.points.size();
  const bool determined = defining + used > 0 || controlled > 1;
  if (!determined && !network.scale_is_free) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        "nothing determines the scale: give a scale bar whose ends are both seen, or a known distance, or control points, "
        "or say that the scale is free");
  }
  if (determined && network.scale_is_free) {
    return fail(ErrorCode::kBadInput,
                "the scale is said to be free, yet a bar or control points are to determine it; choose one of the two");
  }
  if (defining > 0 && controlled > 1) {
    return fail(ErrorCode::kBadInput,
                "a length without a sigma defines the scale, and so do the control points; give the length a sigma");
  }
  return {};
}

Result<> add_rigs(const base::Network& network, Survey& survey) {
  survey.rig_of_camera.assign(survey.cameras.size(), -1);
  survey.station_of_image.assign(survey.images.size(), -1);
  for (const base::NetworkRig& given : network.rigs) {
    const auto bad = [&](const std::string& what) {
      return fail(ErrorCode::kBadInput, fmt::format("rig {}: {}", given.name, what));
    };
    if (given.cameras.size() < 2) return bad("it needs two cameras or more");
    Rig rig{given.name, {}};
    const int number = static_cast<int>(survey.rigs.size());
    for (const std::string& name : given.cameras) {
      const auto camera = std::find_if(survey.cameras.begin(), survey.cameras.end(),
                                       [&](const auto& candidate) { return candidate.name == name; });
      if (camera == survey.cameras.end()) return bad("no image was taken by its camera " + name);
      const auto index = static_cast<std::size_t>(camera - survey.cameras.begin());
      if (survey.rig_of_camera[index] >= 0) return bad("camera " + name + " is named twice");
      survey.rig_of_camera[index] = number;
      rig.cameras.push_back(static_cast<int>(index));
    }
    for (const std::vector<std::string>& names : given.stations) {
      Station station{"", number, {}};
      for (const std::string& name : names) {
        const auto image = std::lower_bound(survey.images.begin(), survey.images.end(), name);
        if (image == survey.images.end() || *image != name) return bad("there is no image " + name);
        const auto index = static_cast<std::size_t>(image - survey.images.begin());
        const int camera = survey.camera_of_image[index];
        if (survey.rig_of_camera[static_cast<std::size_t>(camera)] != number) {
          return bad(fmt::format("image {} is of camera {}, which is not on it", name,
                                 survey.cameras[static_cast<std::size_t>(camera)].name));
        }
        if (survey.station_of_image[index] >= 0) return bad("image " + name + " stands in two stations");
        for (const int other : station.images) {
          if (survey.camera_of_image[static_cast<std::size_t>(other)] == camera) {
            return bad(fmt::format("images {} and {} of one station are of the same camera",
                                   survey.images[static_cast<std::size_t>(other)], name));
          }
        }
        survey.station_of_image[index] = static_cast<int>(survey.stations.size());
        station.images.push_back(static_cast<int>(index));
      }
      if (station.images.empty()) continue;
      std::sort(station.images.begin(), station.images.end(), [&](int a, int b) {
        const auto place = [&](int image) {
          return std::find(rig.cameras.begin(), rig.cameras.end(), survey.camera_of_image[static_cast<std::size_t>(image)]);
        };
        return place(a) < place(b);
      });
      station.name = survey.images[static_cast<std::size_t>(station.images.front())];
      survey.stations.push_back(std::move(station));
    }
    survey.rigs.push_back(std::move(rig));
  }
  return {};
}

Result<> add_control(const base::Network& network, Survey& survey) {
  std::set<int> known;
  for (const base::ControlGroup& group : network.control) {
    const std::string name =
        group.ids.size() == 1 ? fmt::format("control point {}", group.ids.front()) : std::string("control points");
    const auto count = static_cast<Eigen::Index>(3 * group.ids.size());
    if (group.xyz_mm.size() != count || group.cov_mm2.rows() != count || group.cov_mm2.cols() != count ||
        !group.xyz_mm.allFinite() || !group.cov_mm2.allFinite()) {
      return fail(ErrorCode::kBadInput, name + ": coordinates and covariance must be finite and belong to the ids");
    }
    Control control;
    std::vector<Eigen::Index> present;
    std::vector<Eigen::Index> observed;  // of `present`
    for (std::size_t k = 0; k < group.ids.size(); ++k) {
      if (!known.insert(group.ids[k]).second) {
        return fail(ErrorCode::kBadInput, fmt::format("control point {} is given twice", group.ids[k]));
      }
      const int point = survey.point_of(group.ids[k]);
      if (point < 0) {
        survey.warnings.push_back({"control_not_seen", fmt::format("{}", group.ids[k]),
                                   fmt::format("control point {} is seen in no image", group.ids[k])});
        continue;
      }
      control.points.push_back(point);
      control.held.push_back({});
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const Eigen::Index at = 3 * static_cast<Eigen::Index>(k) + axis;
        const bool held = group.cov_mm2(at, at) == 0.0;
        control.held.back()[static_cast<std::size_t>(axis)] = held;
        if (!held) observed.push_back(static_cast<Eigen::Index>(present.size()));
        present.push_back(at);
      }
    }
    if (control.points.empty()) continue;
    control.xyz_mm = group.xyz_mm(present);
    const Eigen::MatrixXd cov = group.cov_mm2(present, present);
    control.sigma_mm = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
    auto root = math::whitening_of(cov(observed, observed), name);
    if (!root) return fail(std::move(root));
    control.whitening = Eigen::MatrixXd::Zero(root->rows(), control.xyz_mm.size());
    control.whitening(Eigen::all, observed) = *root;
    survey.control.push_back(std::move(control));
  }
  return {};
}

Result<> add_datum(const base::Network& network, Survey& survey) {
  if (!network.datum.empty() && !network.control.empty()) {
    return fail(ErrorCode::kBadInput,
                "control points define the frame already; leave out the datum points, or the control points");
  }
  std::set<int> known;
  for (const base::DatumPoint& point : network.datum) {
    if (!point.xyz_mm.allFinite() || !known.insert(point.id).second) {
      return fail(ErrorCode::kBadInput, fmt::format("datum point {} is given twice, or is not finite", point.id));
    }
    const int index = survey.point_of(point.id);
    if (index < 0) {
      survey.warnings.push_back(
          {"datum_point_not_seen", fmt::format("{}", point.id), fmt::format("datum point {} is seen in no image", point.id)});
      continue;
    }
    survey.datum.push_back({index, point.xyz_mm, point.axes});
  }
  if (!network.datum.empty() && survey.datum.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "none of the datum points is seen in an image; compare their ids with the markers'");
  }
  if (!network.datum.empty()) return {};
  for (const Control& control : survey.control) {
    for (std::size_t k = 0; k < control.points.size(); ++k) {
      survey.datum.push_back(
          {control.points[k], control.xyz_mm.segment<3>(3 * static_cast<Eigen::Index>(k)), {true, true, true}});
    }
  }
  return {};
}

Result<> add_start_values(const base::Network& network, Survey& survey) {
  survey.start_poses.resize(survey.images.size());
  survey.start_points.resize(survey.ids.size());
  for (const base::StartPose& start : network.start_poses) {
    const auto image = std::lower_bound(survey.images.begin(), survey.images.end(), start.image);
    if (image == survey.images.end() || *image != start.image) {
      return fail(ErrorCode::kBadInput, "there is a start pose of the image " + start.image + ", but no such image");
    }
    survey.start_poses[static_cast<std::size_t>(image - survey.images.begin())] = start.network_from_camera;
  }
  for (const base::ReferencePoint& start : network.start_points) {
    if (const int point = survey.point_of(start.id); point >= 0)
      survey.start_points[static_cast<std::size_t>(point)] = start.xyz_mm;
  }
  return {};
}

}  // namespace crosstie::bundle::detail
