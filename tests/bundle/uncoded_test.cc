// Uncoded targets whose truth is known: which dot belongs to which target, and where the targets are.
#include "bundle/detail/uncoded.h"

#include <algorithm>
#include <map>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "bundle/adjust.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "tests/bundle/normalised_square.h"
#include "tests/bundle/sampled_ellipse.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

using base::ObservationStatus;

constexpr int kSpurious = -1;

struct TrueDot {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  int target = kSpurious;
};

/// A synthetic network of coded points with uncoded targets among them.
struct Scene {
  tests::SyntheticNetwork coded;
  std::vector<Eigen::Vector3d> targets;
  std::vector<std::vector<TrueDot>> dots;  ///< of each image
};

struct SceneOptions {
  int targets = 300;
  double off_plane_mm = 120.0;
  double missing = 0.25;   ///< share of the dots that a detector did not find
  double spurious = 0.30;  ///< share of all dots that are none
  double noise_px = 0.02;
  double radius_mm = 4.0;
  std::uint64_t seed = 1;
};

base::Observation observe(const tests::SampledEllipse& ellipse, double noise_px, tests::Random& random) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(ellipse.shape_px2);
  base::Observation observation;
  observation.centre_px = ellipse.centre_px + noise_px * Eigen::Vector2d(random.normal(), random.normal());
  observation.cov_px2 = noise_px * noise_px * Eigen::Matrix2d::Identity();
  observation.semi_major_px = std::sqrt(axes.eigenvalues()(1)) + noise_px * random.normal();
  observation.semi_minor_px = std::sqrt(axes.eigenvalues()(0)) + noise_px * random.normal();
  observation.angle_rad = std::atan2(axes.eigenvectors()(1, 1), axes.eigenvectors()(0, 1));
  observation.status = ObservationStatus::kUncoded;
  return observation;
}

void add_targets(Scene& scene, const SceneOptions& options) {
  tests::Random random(1000 + options.seed);
  std::vector<Eigen::Vector3d> normals;
  // Discs cannot overlap: a place that is taken is drawn anew.
  while (static_cast<int>(scene.targets.size()) < options.targets) {
    const double z = scene.targets.size() % 2 == 0 ? 0.0 : options.off_plane_mm * random.uniform(-1.0, 1.0);
    const Eigen::Vector3d place(random.uniform(-300.0, 300.0), random.uniform(-240.0, 240.0), z);
    const bool is_free = std::all_of(scene.targets.begin(), scene.targets.end(), [&](const Eigen::Vector3d& other) {
      return (other - place).norm() > 2.5 * options.radius_mm;
    });
    if (!is_free) continue;
    scene.targets.push_back(place);
    normals.push_back(Eigen::Vector3d(random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), 1.0).normalized());
  }
  for (std::size_t i = 0; i < scene.coded.network.images.size(); ++i) {
    auto& image = scene.coded.network.images[i];
    const auto& camera = scene.coded.cameras[i % scene.coded.cameras.size()];
    const base::Pose camera_from_network = scene.coded.network_from_camera[i].inverse();
    std::vector<TrueDot> dots;
    for (std::size_t t = 0; t < scene.targets.size(); ++t) {
      const auto rim = tests::rim_px(camera, camera_from_network, scene.targets[t], normals[t], options.radius_mm);
      if (rim.empty() || random.uniform() < options.missing) continue;
      const bool inside = std::all_of(rim.begin(), rim.end(), [](const Eigen::Vector2d& p) {
        return p.x() > 2.0 && p.y() > 2.0 && p.x() < 1997.0 && p.y() < 1330.0;
      });
      if (!inside) continue;
      image.observations.push_back(observe(tests::ellipse_through(rim), options.noise_px, random));
      dots.push_back({image.observations.back().centre_px, static_cast<int>(t)});
    }
    const auto spurious = static_cast<int>(options.spurious / (1.0 - options.spurious) * static_cast<double>(dots.size()));
    for (int k = 0; k < spurious; ++k) {
      const double radius_px = random.uniform(5.0, 9.0);
      const tests::SampledEllipse glare = {{random.uniform(10.0, 1990.0), random.uniform(10.0, 1320.0)},
                                           radius_px * radius_px * Eigen::Matrix2d::Identity()};
      image.observations.push_back(observe(glare, options.noise_px, random));
      dots.push_back({image.observations.back().centre_px, kSpurious});
    }
    scene.dots.push_back(std::move(dots));
  }
}

Scene make_scene(const tests::SyntheticOptions& coded, const SceneOptions& options) {
  Scene scene;
  scene.coded = tests::make_synthetic(coded);
  add_targets(scene, options);
  return scene;
}

/// The true target of each adjusted uncoded point; every ray must be one of its dots.
std::map<int, int> true_targets(const Scene& scene, const base::AdjustedNetwork& result) {
  std::map<int, int> target_of;
  std::map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < scene.coded.network.images.size(); ++i) index[scene.coded.network.images[i].image] = i;
  for (const auto& ray : result.residuals) {
    const base::AdjustedPoint& point = result.points[static_cast<std::size_t>(ray.point)];
    if (point.kind != "uncoded") continue;
    const auto& dots = scene.dots[index.at(result.images[static_cast<std::size_t>(ray.image)].name)];
    const auto nearest = std::min_element(dots.begin(), dots.end(), [&](const TrueDot& a, const TrueDot& b) {
      return (a.centre_px - ray.measured_px).squaredNorm() < (b.centre_px - ray.measured_px).squaredNorm();
    });
    EXPECT_LT((nearest->centre_px - ray.measured_px).norm(), 0.2);
    EXPECT_NE(nearest->target, kSpurious) << "point " << point.id;
    const auto [known, added] = target_of.emplace(point.id, nearest->target);
    EXPECT_EQ(known->second, nearest->target) << "point " << point.id << " mixes two targets";
  }
  std::set<int> once;
  for (const auto& [id, target] : target_of) EXPECT_TRUE(once.insert(target).second) << "target " << target << " twice";
  return target_of;
}

/// Targets that three images show.
int findable(const Scene& scene) {
  std::vector<int> count(scene.targets.size(), 0);
  for (const auto& image : scene.dots) {
    for (const TrueDot& dot : image) {
      if (dot.target != kSpurious) ++count[static_cast<std::size_t>(dot.target)];
    }
  }
  return static_cast<int>(std::count_if(count.begin(), count.end(), [](int c) { return c >= 3; }));
}

int uncoded_points(const base::AdjustedNetwork& result) {
  return static_cast<int>(std::count_if(result.points.begin(), result.points.end(),
                                        [](const base::AdjustedPoint& point) { return point.kind == "uncoded"; }));
}

TEST(Uncoded, TargetsOnAndOffAPlaneAreMatchedRightAmongSpuriousDots) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Scene scene = make_scene({.cameras = 2, .images = 14, .depth_mm = 100.0, .seed = seed}, {.seed = seed});
    const auto result = adjust(scene.coded.network);
    ASSERT_TRUE(result) << result.error().message;
    const auto targets = true_targets(scene, *result);
    ASSERT_GT(findable(scene), 250);
    EXPECT_GE(static_cast<double>(targets.size()), 0.95 * findable(scene));
    EXPECT_EQ(static_cast<int>(targets.size()), uncoded_points(*result));
    int dots = 0;
    for (const auto& image : scene.dots) dots += static_cast<int>(image.size());
    EXPECT_EQ(result->uncoded.found, dots);
    EXPECT_EQ(result->uncoded.matched + static_cast<int>(result->uncoded.left.size()), dots);
    // Spurious dots fill no list of rejections: only rays of points stand there.
    EXPECT_LT(result->rejected.size(), static_cast<std::size_t>(result->uncoded.matched) / 100);
  }
}

TEST(Uncoded, AFlatFieldOfManyTargetsIsMatchedRight) {
  const Scene scene = make_scene({.images = 12, .depth_mm = 0.0}, {.targets = 500, .off_plane_mm = 0.0, .seed = 4});
  const auto result = adjust(scene.coded.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_GE(static_cast<double>(true_targets(scene, *result).size()), 0.95 * findable(scene));
}

TEST(Uncoded, TheirErrorsHaveTheCovarianceThatIsStated) {
  double sum = 0.0;
  int dof = 0;
  for (const std::uint64_t seed : {11U, 12U, 13U}) {
    const Scene scene = make_scene({.cameras = 2, .images = 10, .depth_mm = 100.0, .seed = seed},
                                   {.targets = 120, .noise_px = 0.02, .seed = seed});
    // The true sigmas are given, and nothing is rejected afterwards: the distribution of the errors is known.
    const auto result = adjust(scene.coded.network, {.model_sigma_px = 0.0, .reject_outliers = false});
    ASSERT_TRUE(result) << result.error().message;
    const auto target_of = true_targets(scene, *result);
    ASSERT_GT(target_of.size(), 100U);
    std::vector<math::AlignmentPair> pairs;
    for (const auto& point : result->points) {
      math::AlignmentPair& pair = pairs.emplace_back();
      pair.a_mm = point.xyz_mm;
      pair.b_mm =
          point.kind == "coded" ? scene.coded.point(point.id) : scene.targets[static_cast<std::size_t>(target_of.at(point.id))];
    }
    const auto fit = math::align(pairs, {.with_scale = false, .weighted = false});
    ASSERT_TRUE(fit);
    const auto size = static_cast<Eigen::Index>(3 * pairs.size());
    Eigen::VectorXd error(size);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      error.segment<3>(3 * static_cast<Eigen::Index>(i)) = fit->a_from_b * pairs[i].b_mm - pairs[i].a_mm;
    }
    const Eigen::MatrixXd covariance = result->covariance / (result->sigma0 * result->sigma0);
    sum += tests::normalised_square(error, covariance.bottomRightCorner(size, size), result->conditions);
    dof += static_cast<int>(size) - result->conditions;
  }
  EXPECT_GT(sum, math::chi_square_quantile(0.0005, dof)) << sum / dof;
  EXPECT_LT(sum, math::chi_square_quantile(0.9995, dof)) << sum / dof;
}

TEST(Uncoded, TwoPlacesSufficeForNone) {
  // Twelve images, but from two places only: rolled images confirm each other whatever the depth.
  auto coded = tests::make_synthetic({.images = 12, .depth_mm = 100.0});
  coded.network.cameras[0] = {"c0", coded.cameras[0], false};
  for (std::size_t i = 0; i < coded.network_from_camera.size(); ++i) {
    const double side = i % 2 == 0 ? -1.0 : 1.0;
    coded.network_from_camera[i] = tests::looking_at({side * 400.0, 30.0, 1000.0}, {0.0, 0.0, 0.0},
                                                     0.5 * std::numbers::pi * static_cast<double>(i / 2 % 4));
    auto& image = coded.network.images[i];
    image.observations.clear();
    tests::Random random(50 + i);
    for (std::size_t p = 0; p < coded.ids.size(); ++p) {
      const auto pixel = coded.cameras[0].project(coded.network_from_camera[i].inverse() * coded.points[p]);
      if (!pixel || pixel->x() < 10 || pixel->y() < 10 || pixel->x() > 1990 || pixel->y() > 1320) continue;
      base::Observation observation;
      observation.id = coded.ids[p];
      observation.centre_px = *pixel + 0.02 * Eigen::Vector2d(random.normal(), random.normal());
      observation.cov_px2 = 4e-4 * Eigen::Matrix2d::Identity();
      observation.status = ObservationStatus::kCoded;
      image.observations.push_back(observation);
    }
  }
  Scene scene;
  scene.coded = std::move(coded);
  add_targets(scene, {.targets = 200});
  const auto result = adjust(scene.coded.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(uncoded_points(*result), 0);
  EXPECT_EQ(result->uncoded.matched, 0);
}

TEST(Uncoded, MarkersWithIdsAreNotFoundAgain) {
  auto synthetic = tests::make_synthetic({.images = 14});
  // Id 22 is read in half of the images, in the others it is a dot without a code; id 27 is refused in most of them.
  for (std::size_t i = 0; i < synthetic.network.images.size(); ++i) {
    const std::string& name = synthetic.network.images[i].image;
    if (auto* half = tests::find_observation(synthetic.network, name, 22); half != nullptr && i % 2 == 0) {
      half->id = base::kNoId;
      half->status = ObservationStatus::kUncoded;
    }
    if (auto* refused = tests::find_observation(synthetic.network, name, 27)) {
      refused->status = i % 3 == 0 ? ObservationStatus::kUnreadable : ObservationStatus::kRefused;
      if (i % 3 == 0) refused->id = base::kNoId;
    }
  }
  // Id 33 is half hidden in four images: its dot lies 2 px off, where the rays still meet in one place.
  const Eigen::Vector3d beside = synthetic.point(33) + Eigen::Vector3d(1.0, 0.3, 0.0);
  for (const std::size_t i : {1U, 4U, 7U, 10U}) {
    auto* hidden = tests::find_observation(synthetic.network, synthetic.network.images[i].image, 33);
    ASSERT_NE(hidden, nullptr);
    hidden->id = base::kNoId;
    hidden->status = ObservationStatus::kUnreadable;
    hidden->centre_px = *synthetic.cameras[0].project(synthetic.network_from_camera[i].inverse() * beside);
  }
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(uncoded_points(*result), 0);
  EXPECT_EQ(result->uncoded.targets, 0);
  EXPECT_EQ(result->points.size(), synthetic.ids.size() - 1);
}

TEST(Uncoded, IdsFollowThoseOfCodedMarkers) {
  EXPECT_EQ(detail::first_uncoded_id(71), 1001);
  EXPECT_EQ(detail::first_uncoded_id(1000), 1001);
  EXPECT_EQ(detail::first_uncoded_id(1001), 2001);
  EXPECT_EQ(detail::first_uncoded_id(2000), 2001);
  const Scene scene = make_scene({.images = 10}, {.targets = 60});
  const auto result = adjust(scene.coded.network);
  ASSERT_TRUE(result) << result.error().message;
  double before = -1e9;
  int expected = 1001;
  for (const auto& point : result->points) {
    if (point.kind != "uncoded") continue;
    EXPECT_EQ(point.id, expected++);
    EXPECT_GT(point.xyz_mm.x(), before - 0.1);  // the frame moves a little with the last adjustment
    before = point.xyz_mm.x();
  }
  EXPECT_GT(expected, 1050);
}

TEST(Uncoded, AreLeftAloneWhereTheyAreNotWanted) {
  const Scene scene = make_scene({.images = 10}, {.targets = 60});
  const auto without = adjust(scene.coded.network, {.uncoded = false});
  ASSERT_TRUE(without) << without.error().message;
  EXPECT_EQ(uncoded_points(*without), 0);
  EXPECT_EQ(without->uncoded.found, 0);
  // What is found does not depend on the order in which images and dots are listed.
  const auto result = adjust(scene.coded.network);
  Scene turned = scene;
  std::reverse(turned.coded.network.images.begin(), turned.coded.network.images.end());
  for (auto& image : turned.coded.network.images) std::reverse(image.observations.begin(), image.observations.end());
  const auto again = adjust(turned.coded.network);
  ASSERT_TRUE(result && again);
  ASSERT_EQ(result->points.size(), again->points.size());
  for (std::size_t i = 0; i < result->points.size(); ++i) {
    EXPECT_EQ(result->points[i].id, again->points[i].id);
    EXPECT_EQ(result->points[i].xyz_mm, again->points[i].xyz_mm);
  }
}

}  // namespace
}  // namespace crosstie::bundle
