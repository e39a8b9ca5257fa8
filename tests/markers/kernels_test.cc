// The loops that run in vectors, against plain scalar ones, for every instruction set that this machine has.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "markers/detail/blobs.h"
#include "markers/detail/cover_image.h"
#include "markers/detail/dot_kernel.h"
#include "markers/detail/level_kernels.h"
#include "markers/detect.h"
#include "math/edge_profile.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using namespace detail;

class Kernels : public testing::Test {
 protected:
  void TearDown() override { choose(0); }

  /// 0: all that there are.
  static void choose(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }

  template <typename Check>
  static void for_each_target(Check&& check) {
    int count = 0;
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      choose(target);
      SCOPED_TRACE(hwy::TargetName(target));
      check();
      choose(0);
      ++count;
    }
    EXPECT_GE(count, 1);
  }
};

struct Grey {
  int width, height;
  std::ptrdiff_t stride;
  std::vector<std::uint8_t> samples;

  [[nodiscard]] GreyPlane plane() const { return {samples.data(), width, height, stride}; }
  [[nodiscard]] int at(int x, int y) const {
    return samples[static_cast<std::size_t>(std::clamp(y, 0, height - 1) * stride + std::clamp(x, 0, width - 1))];
  }
};

Grey random_image(int width, int height, unsigned seed) {
  Grey image{width, height, width + 5, {}};
  std::mt19937 random(seed);
  image.samples.resize(static_cast<std::size_t>(image.stride * height));
  for (std::size_t i = 0; i < image.samples.size(); ++i) {
    image.samples[i] = static_cast<std::uint8_t>(random() % 3 == 0 ? 255 : random() % 256);
  }
  return image;
}

TEST_F(Kernels, CompareWithTheMeanOfTheWindow) {
  for (const auto& [width, height] : {std::pair{8, 8}, std::pair{63, 9}, std::pair{64, 40}, std::pair{131, 70}}) {
    const Grey image = random_image(width, height, 1);
    const std::size_t words = words_per_row(width) * static_cast<std::size_t>(height);
    constexpr int kDelta = 7;
    std::vector<std::uint64_t> first_brighter, first_darker;
    for_each_target([&] {
      std::vector<std::uint64_t> brighter(words), darker(words);
      compare_with_local_mean(image.plane(), kDelta, brighter.data(), darker.data());
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < static_cast<int>(64 * words_per_row(width)); ++x) {
          const std::size_t word = static_cast<std::size_t>(y) * words_per_row(width) + static_cast<std::size_t>(x) / 64;
          const bool over = (brighter[word] >> (x % 64) & 1U) != 0;
          const bool under = (darker[word] >> (x % 64) & 1U) != 0;
          if (x >= width) {
            ASSERT_FALSE(over || under) << "a bit beyond the row";
            continue;
          }
          double sum = 0.0;
          for (int v = y - 16; v < y + 16; ++v) {
            for (int u = x - 16; u < x + 16; ++u) sum += image.at(u, v);
          }
          const double mean = sum / 1024.0;
          // Between them lies the rounding of the mean, of one grey level.
          ASSERT_TRUE(over || !(image.at(x, y) > mean + kDelta + 0.01)) << x << " " << y;
          ASSERT_FALSE(over && image.at(x, y) <= mean + kDelta - 1.0) << x << " " << y;
          ASSERT_TRUE(under || !(image.at(x, y) < mean - kDelta - 1.0)) << x << " " << y;
          ASSERT_FALSE(under && image.at(x, y) >= mean - kDelta + 0.01) << x << " " << y;
        }
      }
      if (first_brighter.empty()) {
        first_brighter = brighter;
        first_darker = darker;
      }
      EXPECT_EQ(brighter, first_brighter);
      EXPECT_EQ(darker, first_darker);
    });
  }
}

TEST_F(Kernels, HalveAndCountExactly) {
  const Grey image = random_image(141, 33, 2);
  for_each_target([&] {
    std::vector<std::uint8_t> half(70 * 16);
    halve(image.plane(), half.data());
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 70; ++x) {
        const int sum =
            image.at(2 * x, 2 * y) + image.at(2 * x + 1, 2 * y) + image.at(2 * x, 2 * y + 1) + image.at(2 * x + 1, 2 * y + 1);
        ASSERT_EQ(half[static_cast<std::size_t>(70 * y + x)], (sum + 2) / 4);
      }
    }
    const LevelCounts counts = count_levels(image.samples.data(), 141, std::uint8_t{255}, std::uint8_t{20});
    EXPECT_EQ(counts.high, std::count(image.samples.begin(), image.samples.begin() + 141, 255));
    EXPECT_EQ(counts.low, std::count_if(image.samples.begin(), image.samples.begin() + 141, [](int v) { return v <= 20; }));
    std::vector<std::uint16_t> deep(77);
    for (std::size_t i = 0; i < deep.size(); ++i) deep[i] = static_cast<std::uint16_t>(i * 800);
    const LevelCounts deep_counts = count_levels(deep.data(), 77, std::uint16_t{40000}, std::uint16_t{1600});
    EXPECT_EQ(deep_counts.high, 27);
    EXPECT_EQ(deep_counts.low, 3);
    for (const int width : {9, 10, 16, 17, 18, 40, 64}) {
      int darkest = 255, brightest = 0, steepest = 0;
      for (int y = 5; y < 25; ++y) {
        for (int x = 3; x < 3 + width; ++x) {
          darkest = std::min(darkest, image.at(x, y));
          brightest = std::max(brightest, image.at(x, y));
          if (x > 3) steepest = std::max(steepest, std::abs(image.at(x, y) - image.at(x - 1, y)));
          if (y > 5) steepest = std::max(steepest, std::abs(image.at(x, y) - image.at(x, y - 1)));
        }
      }
      const LevelRange range = level_range(image.samples.data() + 5 * image.stride + 3, image.stride, width, 20);
      EXPECT_EQ(range.darkest, darkest) << width;
      EXPECT_EQ(range.brightest, brightest) << width;
      EXPECT_EQ(range.steepest, steepest) << width;
    }
  });
}

/// A disc through the blur against sums over fine samples, with the derivatives.
TEST_F(Kernels, CoverThroughTheBlurIsTheIntegral) {
  constexpr double kRadius = 3.3;
  const Eigen::Vector2d centre(10.4, 9.7);
  for (const double blur_px : {0.6, 1.25}) {
    const auto exact = [&](double x, double y) {
      double sum = 0.0;
      // Rows at v = R sin t, so that chords shrink smoothly.
      constexpr int kRows = 400;
      constexpr double kTurn = std::numbers::pi / kRows;
      for (int k = 0; k < kRows; ++k) {
        const double t0 = -0.5 * std::numbers::pi + (k + 0.5) * kTurn;
        const double v = kRadius * std::sin(t0);
        const double half = kRadius * std::cos(t0);
        const auto below = [&](double t) { return 0.5 * std::erfc(-t / (blur_px * std::numbers::sqrt2)); };
        const double dy = (y - centre.y() - v) / blur_px;
        sum += kTurn * half * std::exp(-0.5 * dy * dy) / (blur_px * std::sqrt(2.0 * std::numbers::pi)) *
               (below(x - centre.x() + half) - below(x - centre.x() - half));
      }
      return sum;
    };
    std::vector<Eigen::Vector2d> corners;
    constexpr int kCorners = 720;
    for (int k = 0; k < kCorners; ++k) {
      const double phi = 2.0 * std::numbers::pi * k / kCorners;
      corners.emplace_back(centre + kRadius * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    }
    for_each_target([&] {
      CoverImage cover({2, 3, 17, 15}, blur_px);
      cover.add(corners);
      const BlurredCover blurred = cover.blurred();
      // All of the disc's light, in its place.
      Eigen::Vector3d moments(0.0, 0.0, 0.0);
      for (int y = 3; y < 18; ++y) {
        for (int x = 2; x < 19; ++x) {
          moments += static_cast<double>(blurred.value[*blurred.index(x, y)]) * Eigen::Vector3d(1.0, x, y);
        }
      }
      EXPECT_NEAR(moments[0], std::numbers::pi * kRadius * kRadius, 0.01);
      EXPECT_LT((moments.tail<2>() / moments[0] - centre).norm(), 5e-4);
      EXPECT_FALSE(blurred.index(1, 5) || blurred.index(19, 5) || blurred.index(5, 18));
      for (int y = 3; y < 18; ++y) {
        for (int x = 2; x < 19; ++x) {
          const auto k = blurred.index(x, y);
          ASSERT_TRUE(k);
          constexpr double kStep = 0.01;
          const auto at = [&](double dx, double dy) { return exact(x + kStep * dx, y + kStep * dy); };
          EXPECT_NEAR(static_cast<double>(blurred.value[*k]), at(0, 0), 3e-3);
          EXPECT_NEAR(static_cast<double>(blurred.x[*k]), (at(1, 0) - at(-1, 0)) / (2.0 * kStep), 6e-3);
          EXPECT_NEAR(static_cast<double>(blurred.y[*k]), (at(0, 1) - at(0, -1)) / (2.0 * kStep), 6e-3);
          EXPECT_NEAR(static_cast<double>(blurred.xy[*k]),
                      (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4.0 * kStep * kStep), 8e-3);
        }
      }
    });
  }
}

/// The model of dot_fit.h in double precision; the set-back of the edge can be given, as it is constant in the derivatives.
struct Reference {
  std::array<double, kDotColumns> p;  // cx cy axx axy ayy blur o ox oy i ix iy
  double saturated;

  [[nodiscard]] double set_back(double x, double y) const {
    const double ex = x - p[0], ey = y - p[1];
    const double gx = p[2] * ex + p[3] * ey, gy = p[3] * ex + p[4] * ey;
    const double rho = std::sqrt(ex * gx + ey * gy), g = std::hypot(gx, gy);
    const double curvature = (p[2] * gy * gy - 2.0 * p[3] * gx * gy + p[4] * gx * gx) / (g * g * g) * rho;
    return 0.5 * curvature;  // times blur^2
  }
  [[nodiscard]] double grey(double x, double y, double half_curvature) const {
    const double ex = x - p[0], ey = y - p[1];
    const double gx = p[2] * ex + p[3] * ey, gy = p[3] * ex + p[4] * ey;
    const double rho = std::sqrt(ex * gx + ey * gy);
    const double distance = (rho - 1.0) * rho / std::hypot(gx, gy) + half_curvature * p[5] * p[5];
    const double inside = 0.5 * std::erfc(distance / (p[5] * std::numbers::sqrt2));
    const double outer = p[6] + p[7] * x + p[8] * y;
    const double inner = p[9] + p[10] * x + p[11] * y;
    return std::min(outer + (inner - outer) * inside, saturated);
  }
};

TEST_F(Kernels, SumTheDotAsAScalarLoopDoes) {
  const Reference model{{0.04, -0.07, 1.1, 0.25, 0.95, 0.11, 21.0, 2.0, -1.0, 240.0, 3.0, 4.0}, 236.0};
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> place(-1.6, 1.6);
  std::normal_distribution<double> noise(0.0, 2.0);
  constexpr std::size_t kCount = 592;  // more than one chunk and not a multiple of all vectors' lengths
  std::vector<float> x(kCount), y(kCount), grey(kCount), weight(kCount), limit2(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    x[i] = static_cast<float>(place(random));
    y[i] = static_cast<float>(place(random));
    const double xi = static_cast<double>(x[i]), yi = static_cast<double>(y[i]);
    grey[i] = static_cast<float>(model.grey(xi, yi, model.set_back(xi, yi)) + noise(random) + (i % 29 == 0 ? 60.0 : 0.0));
    weight[i] = i + 7 < kCount ? static_cast<float>(0.2 + 0.1 * static_cast<double>(i % 3)) : 0.0F;
    limit2[i] = 60.0F;
  }
  std::array<double, kAllColumns * kAllColumns> normal{};
  std::array<double, kAllColumns> right{};
  double cost = 0.0, squares = 0.0;
  const std::array<double, 4> unit{1.0, 0.2, -0.1, 0.9};
  for (std::size_t i = 0; i + 7 < kCount; ++i) {
    const double xi = static_cast<double>(x[i]), yi = static_cast<double>(y[i]);
    const double half_curvature = model.set_back(xi, yi);
    const double predicted = model.grey(xi, yi, half_curvature);
    const double r = std::min(static_cast<double>(grey[i]), model.saturated) - predicted;
    const double w = static_cast<double>(weight[i]);
    const double ratio = r * r / 60.0;
    squares += r * r;
    cost += ratio <= 1.0 ? w * r * r : w * 60.0 * (1.0 + std::log(ratio));
    if (predicted >= model.saturated) continue;
    std::array<double, kAllColumns> j{};
    for (std::size_t k = 0; k < kDotColumns; ++k) {
      constexpr double kStep = 1e-6;
      Reference up = model, down = model;
      up.saturated = down.saturated = 1e9;
      up.p[k] += kStep;
      down.p[k] -= kStep;
      j[k] = (up.grey(xi, yi, half_curvature) - down.grey(xi, yi, half_curvature)) / (2.0 * kStep);
    }
    // The edge moved out by the harmonics: its slope along the distance, from the set-back's derivative.
    Reference open = model;
    open.saturated = 1e9;
    const double per_distance = (open.grey(xi, yi, half_curvature + 1e-6) - open.grey(xi, yi, half_curvature - 1e-6)) /
                                (2e-6 * model.p[5] * model.p[5]);
    const double ex = xi - model.p[0], ey = yi - model.p[1];
    const double phi = std::atan2(unit[2] * ex + unit[3] * ey, unit[0] * ex + unit[1] * ey);
    const double rho = std::sqrt(model.p[2] * ex * ex + 2.0 * model.p[3] * ex * ey + model.p[4] * ey * ey);
    const double length = std::hypot(unit[0] * ex + unit[1] * ey, unit[2] * ex + unit[3] * ey) / rho;
    for (int h = 0; h < kEdgeHarmonics / 2; ++h) {
      // The kernel divides by rho: on the unit circle, where it is used, `length` is 1.
      const double scale = std::pow(length, h + 3);
      j[static_cast<std::size_t>(kDotColumns + 2 * h)] = -per_distance * scale * std::cos((h + 3) * phi);
      j[static_cast<std::size_t>(kDotColumns + 2 * h + 1)] = -per_distance * scale * std::sin((h + 3) * phi);
    }
    const double robust = w * std::min(1.0, 1.0 / ratio);
    for (std::size_t b = 0; b < kAllColumns; ++b) {
      right[b] += robust * r * j[b];
      for (std::size_t a = 0; a <= b; ++a) normal[b * kAllColumns + a] += robust * j[a] * j[b];
    }
  }
  const auto f = [&](std::size_t k) { return static_cast<float>(model.p[k]); };
  const DotModel single{f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8), f(9), f(10), f(11), 236.0F};
  const std::array<float, 4> single_unit{1.0F, 0.2F, -0.1F, 0.9F};
  for_each_target([&] {
    for (const bool harmonics : {false, true}) {
      DotSums sums;
      sum_dot(single, {x.data(), y.data(), grey.data(), weight.data(), limit2.data(), kCount},
              harmonics ? single_unit.data() : nullptr, sums);
      const std::size_t columns = harmonics ? kAllColumns : kDotColumns;
      // Single precision, and the reference's finite differences.
      constexpr double kRelative = 3e-5;
      EXPECT_NEAR(sums.cost, cost, kRelative * cost);
      EXPECT_NEAR(sums.squares, squares, kRelative * squares);
      for (std::size_t b = 0; b < columns; ++b) {
        const double norm_b = std::sqrt(normal[b * kAllColumns + b]);
        EXPECT_NEAR(sums.right[b], right[b], kRelative * norm_b * std::sqrt(cost)) << b;
        for (std::size_t a = 0; a <= b; ++a) {
          const double norm_a = std::sqrt(normal[a * kAllColumns + a]);
          EXPECT_NEAR(sums.normal[b * kAllColumns + a], normal[b * kAllColumns + a], kRelative * norm_a * norm_b)
              << a << " " << b;
        }
      }
    }
  });
}

TEST_F(Kernels, BlobsAreConnectedSetsWithTheirMoments) {
  const int width = 150, height = 60;
  std::vector<std::uint64_t> words(words_per_row(width) * height);
  std::vector<int> label(static_cast<std::size_t>(width * height), -1);
  std::mt19937 random(4);
  for (int i = 0; i < width * height; ++i) {
    if (random() % 100 >= 55) continue;
    label[static_cast<std::size_t>(i)] = 0;
    words[static_cast<std::size_t>(i / width) * words_per_row(width) + static_cast<std::size_t>(i % width) / 64] |=
        std::uint64_t{1} << (i % width % 64);
  }
  // Flood fill, in the order of the first pixels.
  std::vector<Blob> expected;
  for (int start = 0; start < width * height; ++start) {
    if (label[static_cast<std::size_t>(start)] != 0) continue;
    Blob blob{0, 0, 0, 0, 0, 0, width, 0, height, 0};
    std::vector<int> open{start};
    label[static_cast<std::size_t>(start)] = 1;
    while (!open.empty()) {
      const int at = open.back();
      open.pop_back();
      const int px = at % width, py = at / width;
      ++blob.count;
      blob.x += px;
      blob.y += py;
      blob.xx += px * px;
      blob.xy += px * py;
      blob.yy += py * py;
      blob.left = std::min(blob.left, px);
      blob.right = std::max(blob.right, px);
      blob.top = std::min(blob.top, py);
      blob.bottom = std::max(blob.bottom, py);
      const auto visit = [&](int qx, int qy) {
        if (qx < 0 || qy < 0 || qx >= width || qy >= height || label[static_cast<std::size_t>(qy * width + qx)] != 0) return;
        label[static_cast<std::size_t>(qy * width + qx)] = 1;
        open.push_back(qy * width + qx);
      };
      visit(px - 1, py);
      visit(px + 1, py);
      visit(px, py - 1);
      visit(px, py + 1);
    }
    if (blob.count >= 3) expected.push_back(blob);
  }
  const std::vector<Blob> found = find_blobs(words.data(), width, height, 3);
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_GT(found.size(), 20U);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto numbers = [](const Blob& b) {
      return std::array<std::int64_t, 10>{b.count, b.x, b.y, b.xx, b.xy, b.yy, b.left, b.right, b.top, b.bottom};
    };
    EXPECT_EQ(numbers(found[i]), numbers(expected[i])) << i;
  }
}

TEST_F(Kernels, CentresAreTheSameOnAllInstructionSetsAndInAllRuns) {
  tests::MarkerScene scene;
  scene.family = *marker_family("aicon14");
  scene.code = scene.family.codes[40].code;
  scene.tilt_rad = 0.6;
  const base::Image image = tests::photograph(scene, {2.0, 9});
  const auto centre = [&] {
    const auto found = detect(image.view(), scene.family);
    EXPECT_TRUE(found && found->observations.size() == 1U);
    return found->observations.at(0);
  };
  const base::Observation first = centre();
  const base::Observation again = centre();
  EXPECT_EQ(first.centre_px, again.centre_px);
  EXPECT_EQ(first.cov_px2, again.cov_px2);
  for_each_target([&] {
    const base::Observation here = centre();
    // Sums in another order: a thousandth of the sigma.
    EXPECT_LT((here.centre_px - first.centre_px).norm(), 1e-3 * std::sqrt(first.cov_px2.trace()));
    EXPECT_EQ(here.id, first.id);
  });
}

TEST(EdgeProfile, KeepsToTheNormalDistribution) {
  for (double t = -8.5; t < 8.5; t += 0.0037) {
    const double distribution = 0.5 * std::erfc(-t / std::numbers::sqrt2);
    EXPECT_NEAR(math::edge_profile(t).distribution, distribution, 1e-9) << t;
    EXPECT_NEAR(math::edge_distribution(t), distribution, 1e-5) << t;
  }
}

}  // namespace
}  // namespace crosstie::markers
