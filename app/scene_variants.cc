#include "app/scene_variants.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace crosstie::app {
namespace {

using fixtures::Scene;

/// `keep` of `count` things, evenly spread.
bool kept(std::size_t index, std::size_t count, std::size_t keep) { return (index + 1) * keep / count > index * keep / count; }

template <typename List>
void thin(List& list, std::size_t keep) {
  const std::size_t count = list.size();
  List left;
  for (std::size_t i = 0; i < count; ++i) {
    if (kept(i, count, keep)) left.push_back(list[i]);
  }
  list = std::move(left);
}

fixtures::Body* cross_body(Scene& scene) {
  const auto found = std::find_if(scene.bodies.begin(), scene.bodies.end(), [&](const fixtures::Body& body) {
    return scene.machine && body.name == scene.machine->cross.body;
  });
  return found == scene.bodies.end() ? nullptr : &*found;
}

/// The first `count` balls; beyond those that there are, more of them half-way between their middle and each of them.
Scene with_balls(Scene scene, std::size_t count) {
  std::vector<fixtures::Ball>& balls = cross_body(scene)->balls;
  const std::size_t there = balls.size();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const fixtures::Ball& ball : balls) middle += ball.centre_mm / static_cast<double>(there);
  int id = 0;
  for (const fixtures::Ball& ball : balls) id = std::max(id, ball.id);
  for (std::size_t i = there; i < count; ++i) {
    fixtures::Ball more = balls[i - there];
    more.id = ++id;
    more.centre_mm = 0.5 * (more.centre_mm + middle);
    balls.push_back(more);
  }
  balls.resize(count);
  return scene;
}

std::size_t photographs(const Scene& scene) {
  return static_cast<std::size_t>(std::count_if(scene.views.begin(), scene.views.end(), [](const fixtures::View& view) {
    return view.purpose == fixtures::Purpose::kNetwork;
  }));
}

class Variants {
 public:
  Variants(const Scene& scene, const SurveyOptions& options) : scene_(scene), options_(options) {}

  void add(const char* what, const std::string& value, Scene scene, bool other_board = false) {
    list_.push_back({what, value, std::move(scene), options_, other_board});
  }

  void machine() {
    for (const int count : {3, 4, 5, 6, 7, 9}) add("stations", std::to_string(count), with_stations(scene_, count));
    fixtures::Body* cross = cross_body(scene_);
    if (cross == nullptr) return;
    const std::size_t balls = cross->balls.size();
    for (std::size_t count = 3; count <= std::min<std::size_t>(2 * balls, balls + 4); ++count) {
      add("spheres", std::to_string(count), with_balls(scene_, count));
    }
    markers(*cross);
    Scene finer = scene_;
    finer.machine->probing.sigma_mm *= 0.5;
    add("probe sigma", fmt::format("{:.4g} mm", finer.machine->probing.sigma_mm), finer);
    finer.machine->probing.sigma_mm *= 4.0;
    add("probe sigma", fmt::format("{:.4g} mm", finer.machine->probing.sigma_mm), std::move(finer));
  }

  void markers(const fixtures::Body& body) {
    const std::size_t plates = body.plates.size();
    for (const double share : {0.25, 0.5, 0.75}) {
      const auto keep = static_cast<std::size_t>(std::lround(share * static_cast<double>(plates)));
      if (keep < 6) continue;
      Scene fewer = scene_;
      for (fixtures::Body& one : fewer.bodies) {
        if (one.name == body.name) thin(one.plates, keep);
      }
      add("markers", std::to_string(keep), std::move(fewer));
    }
  }

  void board() {
    const std::size_t poses = scene_.board->rig_from_board.size();
    for (const double share : {0.33, 0.67}) {
      const auto keep = static_cast<std::size_t>(std::lround(share * static_cast<double>(poses)));
      if (keep < 5) continue;
      Scene fewer = scene_;
      thin(fewer.board->rig_from_board, keep);
      add("board poses", std::to_string(keep), std::move(fewer), true);
    }
    Scene rigid = scene_;
    rigid.board->board.prior.pitch_sigma_ppm *= 0.25;
    rigid.board->board.prior.bend_sigma_mm *= 0.25;
    rigid.board->board.prior.sigma_mm *= 0.25;
    add("board prior", "a quarter", std::move(rigid), true);
  }

  void network() {
    const std::size_t count = photographs(scene_);
    for (const std::size_t keep : {std::size_t{6}, std::size_t{8}, std::size_t{12}, std::size_t{16}}) {
      if (keep >= count) continue;
      Scene fewer = scene_;
      std::size_t at = 0;
      std::erase_if(fewer.views, [&](const fixtures::View& view) {
        return view.purpose == fixtures::Purpose::kNetwork && !kept(at++, count, keep);
      });
      add("photographs", std::to_string(keep), std::move(fewer));
    }
    if (scene_.scale_bars.size() > 1) {
      Scene one = scene_;
      one.scale_bars.resize(1);
      add("scale bars", "1", std::move(one));
    }
    const auto largest = std::max_element(scene_.bodies.begin(), scene_.bodies.end(),
                                          [](const auto& a, const auto& b) { return a.plates.size() < b.plates.size(); });
    if (!scene_.machine && largest != scene_.bodies.end()) markers(*largest);
  }

  void noise(const char* what, double SurveyOptions::*sigma) {
    for (const double factor : {0.5, 2.0, 4.0}) {
      SurveyOptions changed = options_;
      changed.*sigma *= factor;
      list_.push_back(
          {what, fmt::format("{:.4g} px", changed.*sigma), scene_, changed, sigma == &SurveyOptions::corner_sigma_px});
    }
  }

  std::vector<SceneVariant> take() { return std::move(list_); }

 private:
  Scene scene_;
  SurveyOptions options_;
  std::vector<SceneVariant> list_;
};

}  // namespace

Scene with_stations(Scene scene, int count) {
  std::vector<fixtures::Station>& stations = scene.machine->stations;
  const auto [first, last] =
      std::minmax_element(stations.begin(), stations.end(), [](const auto& a, const auto& b) { return a.axis_mm < b.axis_mm; });
  const double from_mm = first->axis_mm;
  const double step_mm = count > 1 ? (last->axis_mm - from_mm) / (count - 1) : 0.0;
  stations.clear();
  for (int i = 0; i < count; ++i) {
    const double axis_mm = from_mm + i * step_mm;
    stations.push_back({.name = fmt::format("x{:06.1f}", axis_mm), .axis_mm = axis_mm});
  }
  return scene;
}

std::vector<SceneVariant> scene_variants(const Scene& scene, const SurveyOptions& options) {
  Variants variants(scene, options);
  const bool machine = scene.machine && !scene.machine->stations.empty();
  const bool network = photographs(scene) > 0 && (!machine || scene.machine->cross.points_from_adjust);
  if (machine) variants.machine();
  if (network) variants.network();
  if (machine || network) variants.noise("image sigma", &SurveyOptions::image_sigma_px);
  if (scene.board) {
    variants.board();
    variants.noise("corner sigma", &SurveyOptions::corner_sigma_px);
  }
  return variants.take();
}

}  // namespace crosstie::app
