// Edges at known places, blurred and noisy: position, sigma, class, direction. The pictures are analytic: two surfaces, mixed by the point
// spread's share on either side of a circle.
#include "scan/edge_pixels.h"

#include <array>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/edge_pixels.h"
#include "scan/decode.h"
#include "scan/detail/step_profile.h"
#include "tests/scan/synthetic_scan.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::scan {
namespace {

using base::EdgeClass;

constexpr int kWidth = 160;
constexpr int kHeight = 128;
const Eigen::Vector2d kCentre(79.3, 63.6);
constexpr double kRadius = 36.2;

/// What a surface sends back: a mean level, a modulation, the projector's coordinate.
struct Surface {
  double mean = 0.0;
  double modulation = 0.0;
  double u_offset = 0.0;
  double u_slope = 1.0;
};

/// A disc that is cut out of a face; between both, optionally, a band (a chamfer) `band_px` wide.
struct Scene {
  Surface face = {60.0, 40.0, 0.0, 1.0};
  Surface beyond = {20.0, 0.0, 0.0, 1.0};
  Surface band = {110.0, 70.0, 0.0, 1.0};
  double band_px = 0.0;
  double blur_px = 0.7;
  double grain = 0.0;  ///< of the face's brightness, relative

  [[nodiscard]] base::PhaseMap map(std::uint64_t seed) const {
    const auto sequence = tests::gray_and_fringes(20.0, 6, false, false);
    auto decoder = Decoder::make(sequence, kWidth, kHeight, {});
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<double> albedo(static_cast<std::size_t>(kWidth) * kHeight);
    for (double& value : albedo) value = 1.0 + grain * normal(random);
    // Of each pixel, what the point spread leaves of face, band and what lies beyond: fringes are blurred as well.
    std::vector<std::array<std::complex<double>, 3>> fringes(albedo.size());
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector2d from = Eigen::Vector2d(x, y) - kCentre;
        const double outside = from.norm() - kRadius;
        auto& of = fringes[static_cast<std::size_t>(y * kWidth + x)];
        const std::array<const Surface*, 3> surfaces = {&face, &band, &beyond};
        const std::array<double, 4> ends = {1e3, 0.0, -band_px, -1e3};
        for (std::size_t k = 0; k < 3; ++k) {
          const double per_px = 2.0 * std::numbers::pi * sequence.x.fringes[0] * surfaces[k]->u_slope * 0.7 / kWidth;
          of[k] = spread(ends[k + 1] - outside, ends[k] - outside, per_px * from.normalized());
        }
      }
    }
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
      base::Image image(kWidth, kHeight, 8);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const double outside = (Eigen::Vector2d(x, y) - kCentre).norm() - kRadius;
          const double on_face = share(outside);
          const double on_band = share(outside + band_px) - on_face;
          const auto at = static_cast<std::size_t>(y * kWidth + x);
          const double level = light(face, on_face, fringes[at][0], sequence, sequence.patterns[i], x) * albedo[at] +
                               light(band, on_band, fringes[at][1], sequence, sequence.patterns[i], x) +
                               light(beyond, 1.0 - on_face - on_band, fringes[at][2], sequence, sequence.patterns[i], x);
          const double noisy = level + std::sqrt(0.5 + 0.02 * level) * normal(random);
          image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(std::clamp(std::round(noisy), 0.0, 255.0));
        }
      }
      EXPECT_TRUE(decoder->add(static_cast<int>(i), std::move(image)));
    }
    auto map = decoder->finish();
    EXPECT_TRUE(map) << map.error().message;
    return *std::move(map);
  }

 private:
  [[nodiscard]] double share(double outside) const { return 0.5 * std::erfc(-outside / blur_px / std::numbers::sqrt2); }
  /// The point spread's integral over low..high across the edge [px from the pixel] of a wave whose phase grows by `wave` across and along it.
  [[nodiscard]] std::complex<double> spread(double low, double high, const Eigen::Vector2d& wave) const {
    const double from = std::max(low, -5.0 * blur_px);
    const double to = std::min(high, 5.0 * blur_px);
    if (to <= from) return 0.0;
    constexpr int kSteps = 40;
    std::complex<double> sum = 0.0;
    for (int i = 0; i <= kSteps; ++i) {  // Simpson
      const double t = from + (to - from) * i / kSteps;
      const double weight = i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
      sum += weight * std::exp(-0.5 * t * t / (blur_px * blur_px)) * std::polar(1.0, wave.x() * t);
    }
    sum *= (to - from) / (3.0 * kSteps) / (blur_px * std::sqrt(2.0 * std::numbers::pi));
    return sum * std::exp(-0.5 * std::pow(wave.y() * blur_px, 2));
  }
  /// `share` of a surface, and what is left of the wave on it.
  static double light(const Surface& surface, double share, std::complex<double> wave, const base::PatternSequence& sequence,
                      const base::Pattern& pattern, int x) {
    const double u = std::clamp(0.05 + surface.u_offset + surface.u_slope * 0.7 * x / kWidth, 0.0, 0.999);
    const double turns = sequence.x.fringes[0] * u;
    if (pattern.kind == base::PatternKind::kFringe)
      return surface.mean * share +
             surface.modulation * std::real(wave * std::polar(1.0, 2.0 * std::numbers::pi * (turns - pattern.shift)));
    const int word = static_cast<int>(std::floor(turns / sequence.x.word_periods));
    const bool set = (((word ^ (word >> 1)) >> (sequence.x.gray_bits - 1 - pattern.bit)) & 1) != 0;
    return share * (surface.mean + (set ? 1.0 : -1.0) * surface.modulation);
  }
};

/// Signed distances from the true circle, to its outside.
struct Errors {
  double mean = 0.0;
  double rms = 0.0;
  double normalised = 0.0;  ///< mean square over the squared sigma
  int count = 0;
  int far = 0;  ///< farther than half a pixel
};

Errors errors_of(const std::vector<base::EdgePixels>& all, EdgeClass kind) {
  Errors errors;
  for (const base::EdgePixels& edges : all) {
    for (const base::EdgePixel& edge : edges.pixels) {
      const Eigen::Vector2d from = edge.at_px - kCentre;
      if (edge.kind != kind || std::abs(from.norm() - kRadius) > 6.0) continue;
      const double off = from.norm() - kRadius;
      if (std::abs(off) > 0.5) {
        ++errors.far;
        continue;
      }
      ++errors.count;
      errors.mean += off;
      errors.rms += off * off;
      errors.normalised += off * off / (edge.sigma_px * edge.sigma_px);
    }
  }
  errors.mean /= errors.count;
  errors.rms = std::sqrt(errors.rms / errors.count);
  errors.normalised /= errors.count;
  return errors;
}

std::vector<base::EdgePixels> edges_of(const Scene& scene, int seeds, const std::vector<float>* depth_mm = nullptr) {
  std::vector<base::EdgePixels> all;
  for (int seed = 1; seed <= seeds; ++seed) {
    const base::PhaseMap map = scene.map(static_cast<std::uint64_t>(seed));
    auto edges = find_edges({&map, nullptr, depth_mm}, {});
    EXPECT_TRUE(edges) << edges.error().message;
    all.push_back(*std::move(edges));
  }
  return all;
}

TEST(EdgePixels, RimBeforeTheDarkIsMetWithItsSigma) {
  const auto all = edges_of({}, 3);
  const Errors errors = errors_of(all, EdgeClass::kMaterial);
  SCOPED_TRACE(testing::Message() << errors.count << " " << errors.far << " mean " << errors.mean << " rms " << errors.rms
                                  << " normalised " << errors.normalised << " blur " << all.front().blur_px);
  EXPECT_GT(errors.count, 3 * 150);
  EXPECT_LT(errors.far, errors.count / 100);
  EXPECT_LT(std::abs(errors.mean), 0.01);
  EXPECT_LT(errors.rms, 0.05);
  EXPECT_NEAR(errors.normalised, 1.0, 0.4);
  for (const auto& edges : all) {
    EXPECT_NEAR(edges.blur_px, 0.7, 0.05);
    for (const auto& edge : edges.pixels) {
      if (edge.kind != EdgeClass::kMaterial) continue;
      EXPECT_GT(edge.out.dot((kCentre - edge.at_px).normalized()), 0.95) << edge.at_px.transpose();  // into the hole
    }
  }
}

TEST(EdgePixels, RimBeforeAWallIsMaterialSinceItsPhasesJump) {
  Scene scene;
  scene.beyond = {90.0, 60.0, 0.12, 1.0};
  const Errors errors = errors_of(edges_of(scene, 3), EdgeClass::kMaterial);
  EXPECT_GT(errors.count, 3 * 100);  // two thirds of what is found before the dark
  EXPECT_LT(errors.far, errors.count / 100);
  EXPECT_LT(std::abs(errors.mean), 0.02);
  EXPECT_NEAR(errors.normalised, 1.0, 0.4);
}

TEST(EdgePixels, FaceEdgeIsFoundBesideABrightChamfer) {
  Scene scene;
  scene.band_px = 2.2;
  const auto all = edges_of(scene, 3);
  const Errors errors = errors_of(all, EdgeClass::kMaterial);
  SCOPED_TRACE(testing::Message() << errors.count << " " << errors.far << " mean " << errors.mean << " rms " << errors.rms
                                  << " normalised " << errors.normalised << " blur " << all.front().blur_px);
  EXPECT_GT(errors.count, 3 * 150);
  EXPECT_LT(errors.far, errors.count / 50);  // the chamfer's other edge lies 2.2 px away
  EXPECT_LT(std::abs(errors.mean), 0.03);
  EXPECT_LT(errors.normalised, 1.5);
  EXPECT_GT(errors.normalised,
            0.1);  // sigma counts with a point spread that varies over the image: here it is the same everywhere
  double band = 0.0;
  int count = 0;
  for (const auto& edges : all) {
    for (const auto& edge : edges.pixels) {
      if (edge.kind != EdgeClass::kMaterial || edge.band_px == 0.0) continue;
      band += edge.band_px;
      ++count;
    }
  }
  EXPECT_NEAR(band / count, 2.2, 0.1);
}

TEST(EdgePixels, GrainOfTheSurfaceIsInTheSigma) {
  Scene scene;
  scene.grain = 0.15;
  const Errors errors = errors_of(edges_of(scene, 3), EdgeClass::kMaterial);
  EXPECT_GT(errors.count, 3 * 150);
  EXPECT_LT(std::abs(errors.mean), 0.03);
  EXPECT_LT(errors.normalised, 1.5);
  EXPECT_GT(errors.normalised, 0.1);  // white grain is counted as if the point spread had blurred it
}

TEST(EdgePixels, PaintIsPaintSincePhasesGoOn) {
  Scene scene;
  scene.beyond = {25.0, 17.0, 0.0, 1.0};
  const auto all = edges_of(scene, 2);
  EXPECT_LT(errors_of(all, EdgeClass::kMaterial).count, 20);
  const Errors errors = errors_of(all, EdgeClass::kPaint);
  EXPECT_GT(errors.count, 2 * 150);
  EXPECT_LT(std::abs(errors.mean), 0.02);
}

TEST(EdgePixels, LightThatEndsBeforeNearerMaterialIsAShadow) {
  const Scene scene;
  // The disc is dark. What is seen across it decides: nearer material to the right of it casts a shadow on what lies to the left.
  std::vector<float> depth(static_cast<std::size_t>(kWidth) * kHeight, 1000.0F);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      auto& here = depth[static_cast<std::size_t>(y * kWidth + x)];
      if ((Eigen::Vector2d(x, y) - kCentre).norm() < kRadius + 2.0)
        here = std::nanf("");
      else if (x > kCentre.x())
        here = 900.0F;
    }
  }
  int shadow_left = 0, material_left = 0, shadow_right = 0, material_right = 0;
  for (const auto& edge : edges_of(scene, 1, &depth).front().pixels) {
    const Eigen::Vector2d from = edge.at_px - kCentre;
    if (std::abs(from.x()) < 0.8 * kRadius) continue;  // there the way across does not lead from one side to the other
    (edge.kind == EdgeClass::kShadow ? (from.x() < 0.0 ? shadow_left : shadow_right)
                                     : (from.x() < 0.0 ? material_left : material_right))++;
  }
  EXPECT_GT(shadow_left, 30);
  EXPECT_EQ(material_left, 0);
  EXPECT_GT(material_right, 30);
  EXPECT_EQ(shadow_right, 0);
}

TEST(EdgePixels, OptionsAndSizesAreChecked) {
  const base::PhaseMap map = Scene().map(1);
  EXPECT_EQ(find_edges({&map}, {.half_piece_px = 0.0}).error().code, base::ErrorCode::kUsage);
  const base::Image other(10, 10, 8);
  EXPECT_EQ(find_edges({&map, &other}, {}).error().code, base::ErrorCode::kBadInput);
  const auto one = find_edges({&map}, {.threads = 1});
  const auto three = find_edges({&map}, {.threads = 3});
  ASSERT_EQ(one->pixels.size(), three->pixels.size());
  for (std::size_t i = 0; i < one->pixels.size(); ++i) EXPECT_EQ(one->pixels[i].at_px, three->pixels[i].at_px);
}

TEST(EdgePixels, TableIsReadBack) {
  const tests::TemporaryFolder work;
  auto edges = edges_of({}, 1);
  edges.front().camera = "left";
  ASSERT_TRUE(base::write_edge_pixels(work / "e.csv", edges));
  const auto back = base::read_edge_pixels(work / "e.csv");
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->size(), 1U);
  EXPECT_EQ(back->front().camera, "left");
  ASSERT_EQ(back->front().pixels.size(), edges.front().pixels.size());
  for (std::size_t i = 0; i < back->front().pixels.size(); ++i) {
    const auto& a = edges.front().pixels[i];
    const auto& b = back->front().pixels[i];
    EXPECT_LT((a.at_px - b.at_px).norm(), 1e-4);
    EXPECT_NEAR(a.sigma_px, b.sigma_px, 1e-4);
    EXPECT_EQ(a.kind, b.kind);
  }
}

TEST(StepProfile, IsNotPulledByANeighbouringStep) {
  // A face at 60, a chamfer at 110 from 0 to 2 px, dark beyond: the maximum of the gradient near 0 lies outside of it.
  const double blur = 0.8;
  const auto share = [&](double t) { return 0.5 * std::erfc(-t / blur / std::numbers::sqrt2); };
  detail::ProfileSamples samples;
  for (double t = -7.0; t <= 7.0; t += 0.1) samples.add(t, {60.0 + 50.0 * share(t) - 100.0 * share(t - 2.0)});
  samples.finish(1);
  detail::StepProfile fit;
  const std::array<double, 2> start = {-0.4, 2.3};
  ASSERT_TRUE(detail::fit_steps(samples, {0.5, 0.5, 0.5}, blur, start, 1e-3, fit));
  EXPECT_NEAR(fit.at_px[0], 0.0, 1e-6);
  EXPECT_NEAR(fit.at_px[1], 2.0, 1e-6);
  EXPECT_NEAR(fit.levels[0][1], 110.0, 0.02);  // places are iterated to 1e-3 px
}

}  // namespace
}  // namespace crosstie::scan
