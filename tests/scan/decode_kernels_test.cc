// The loops over pixels that run in vectors, against plain ones in double precision, for every instruction set that this machine has.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "scan/detail/fringe_kernel.h"
#include "scan/detail/phase_kernel.h"
#include "scan/detail/surface_kernel.h"

namespace crosstie::scan::detail {
namespace {

constexpr std::size_t kCount = 139;  // no multiple of any vector's length
constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();

template <typename Check>
void for_each_target(Check&& check) {
  int count = 0;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    SCOPED_TRACE(hwy::TargetName(target));
    check();
    ++count;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  EXPECT_GE(count, 1);
}

class Random {
 public:
  explicit Random(unsigned seed) : random_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
  std::vector<float> floats(std::size_t count, double low, double high) {
    std::vector<float> values(count);
    for (float& value : values) value = static_cast<float>(uniform(low, high));
    return values;
  }

 private:
  std::mt19937 random_;
};

template <typename Sample>
void solve_as_least_squares_do(int white) {
  constexpr int kSteps = 7;
  Random random(1);
  FringePlan plan;
  plan.steps = kSteps;
  plan.square_weight = 0.25F;
  plan.clip_low = 1.0F;
  plan.clip_high = static_cast<float>(white - 1);
  for (int n = 0; n < kSteps; ++n) {
    const double angle = 2.0 * std::numbers::pi * n / kSteps;
    plan.cosine[n] = static_cast<float>(std::cos(angle));
    plan.sine[n] = static_cast<float>(std::sin(angle));
    plan.mean_weight[n] = 1.0F / kSteps;
    plan.a_weight[n] = 2.0F / kSteps * plan.cosine[n];
    plan.b_weight[n] = 2.0F / kSteps * plan.sine[n];
  }
  std::vector<std::vector<Sample>> levels(kSteps, std::vector<Sample>(kCount));
  std::vector<const Sample*> images;
  for (auto& image : levels) {
    for (Sample& level : image) level = static_cast<Sample>(random.whole(2, white - 2));
    images.push_back(image.data());
  }
  for (std::size_t i = 0; i < kCount; i += 10) levels[3][i] = static_cast<Sample>(i % 20 == 0 ? 1 : white - 1);
  for_each_target([&] {
    std::vector<float> turns(kCount), modulation(kCount), mean(kCount), squares(kCount);
    std::vector<std::uint8_t> clipped(kCount);
    EXPECT_TRUE(solve_fringes(plan, images.data(), kCount,
                              {turns.data(), modulation.data(), mean.data(), squares.data(), clipped.data()}));
    for (std::size_t i = 0; i < kCount; ++i) {
      double a = 0.0, b = 0.0, m = 0.0, rest = 0.0;
      bool cut = false;
      const auto level = [&](int n) { return static_cast<double>(levels[static_cast<std::size_t>(n)][i]); };
      const auto angle = [&](int n) { return 2.0 * std::numbers::pi * n / kSteps; };
      for (int n = 0; n < kSteps; ++n) {
        m += level(n) / kSteps;
        a += 2.0 / kSteps * level(n) * std::cos(angle(n));
        b += 2.0 / kSteps * level(n) * std::sin(angle(n));
        cut = cut || level(n) <= 1.0 || level(n) >= white - 1;
      }
      for (int n = 0; n < kSteps; ++n) rest += std::pow(level(n) - m - a * std::cos(angle(n)) - b * std::sin(angle(n)), 2);
      double expected = std::atan2(b, a) / (2.0 * std::numbers::pi);
      expected -= std::floor(expected);
      const double off = static_cast<double>(turns[i]) - expected;
      ASSERT_NEAR(off - std::round(off), 0.0, 1e-6 * white / std::hypot(a, b));
      ASSERT_GE(turns[i], 0.0F);
      ASSERT_LT(turns[i], 1.0F);
      ASSERT_NEAR(modulation[i], std::hypot(a, b), 1e-6 * white);
      ASSERT_NEAR(mean[i], m, 1e-6 * white);
      ASSERT_NEAR(squares[i], 0.25 * rest, 1e-5 * rest);
      ASSERT_EQ(clipped[i] != 0, cut);
    }
  });
}

TEST(DecodeKernels, FringesOfBytesAreSolved) { solve_as_least_squares_do<std::uint8_t>(255); }
TEST(DecodeKernels, FringesOfWordsAreSolved) { solve_as_least_squares_do<std::uint16_t>(65535); }

TEST(DecodeKernels, PhasesAreJudged) {
  Random random(2);
  std::array<std::vector<float>, 3> modulation = {random.floats(kCount, 20.0, 40.0), random.floats(kCount, 20.0, 40.0),
                                                  random.floats(kCount, 20.0, 40.0)};
  for (std::size_t i = 0; i < kCount; i += 7) modulation[1][i] = i % 3 == 0 ? 0.0F : 0.9F;
  for (std::size_t i = 3; i < kCount; i += 11) modulation[1][i] = 5.0F;
  const auto mean = random.floats(kCount, 0.0, 200.0), squares = random.floats(kCount, 0.0, 30.0);
  const auto gains = random.floats(kCount, 0.2, 0.6);
  const PhaseLimits limits{0.25F, 1.0F, 0.05F, 1e-3F, 100.0F, 1.0F, 0.03F, 4.0F};
  for (const bool inside : {true, false}) {
    for (const bool each : {true, false}) {
      for_each_target([&] {
        std::vector<float> sigma = squares;
        std::vector<std::uint8_t> status(kCount, 0);
        for (std::size_t i = 5; i < kCount; i += 17) status[i] = 3;
        const auto before = status;
        JudgeSums sums;
        judge_row(limits,
                  {inside ? modulation[0].data() : nullptr, modulation[1].data(), inside ? modulation[2].data() : nullptr,
                   mean.data(), each ? gains.data() : nullptr, sigma.data(), status.data()},
                  kCount, sums);
        std::int64_t tested = 0, disturbed = 0, valid = 0;
        double ratios = 0.0;
        for (std::size_t i = 0; i < kCount; ++i) {
          const double b = modulation[1][i];
          double squared = b * b;
          if (inside && i > 0 && i + 1 < kCount) {
            double around = 0.0;
            for (const auto& row : modulation) {
              for (std::size_t k = i - 1; k <= i + 1; ++k) around += std::pow(static_cast<double>(row[k]), 2) / 9.0;
            }
            if (around < 2.0 * squared && squared < 2.0 * around) squared = around;
          }
          const double variance = std::max(0.09, 1.0 + 0.05 * mean[i]);
          const double amplitude = (each ? gains[i] : 0.25) * variance;
          const double expected = std::sqrt(amplitude / std::max(1e-12, squared - 2.0 * amplitude)) / (2.0 * std::numbers::pi);
          ASSERT_NEAR(sigma[i] / expected, 1.0, 1e-4) << i;
          const double ratio = squares[i] / (variance + 1e-3 * b * b);
          std::uint8_t state = before[i];
          if (state == 0 && b <= 0.0) {
            state = mean[i] < 100.0F ? 1 : 2;
          } else if (state == 0 && (b < 1.0 || expected > 0.03)) {
            state = 1;
          } else if (state == 0) {
            ++tested;
            ratios += ratio;
            if (ratio > 4.0) state = 4;
            if (ratio > 4.0) ++disturbed;
          }
          ASSERT_EQ(status[i], state) << i;
          valid += state == 0 ? 1 : 0;
        }
        EXPECT_GT(disturbed, 5);
        EXPECT_LT(tested, static_cast<std::int64_t>(kCount) - 20);
        EXPECT_EQ(sums.tested, tested);
        EXPECT_EQ(sums.disturbed, disturbed);
        EXPECT_EQ(sums.valid, valid);
        EXPECT_NEAR(sums.ratios, ratios, 1e-4 * ratios);
      });
    }
  }
}

template <typename Sample>
void read_gray_as_one_bit_after_the_other(int white) {
  constexpr std::size_t kBits = 9;
  Random random(3);
  std::vector<std::vector<Sample>> bright(kBits, std::vector<Sample>(kCount)), inverse = bright;
  for (auto* images : {&bright, &inverse}) {
    for (auto& image : *images) {
      for (Sample& level : image) level = static_cast<Sample>(random.whole(0, white));
    }
  }
  const auto mean = random.floats(kCount, 0.0, white), modulation = random.floats(kCount, 0.0, 0.5 * white);
  std::vector<const Sample*> levels, others;
  for (std::size_t bit = 0; bit < kBits; ++bit) {
    levels.push_back(bright[bit].data());
    others.push_back(bit % 2 == 0 ? inverse[bit].data() : nullptr);
  }
  constexpr double kDoubt = 0.25;
  for_each_target([&] {
    std::vector<std::uint16_t> words(kCount);
    std::vector<std::uint8_t> doubtful(kCount);
    read_gray_row(levels.data(), others.data(), kBits, static_cast<float>(kDoubt), mean.data(), modulation.data(), kCount,
                  words.data(), doubtful.data());
    for (std::size_t i = 0; i < kCount; ++i) {
      unsigned word = 0, parity = 0, doubts = 0;
      for (std::size_t bit = 0; bit < kBits; ++bit) {
        const double scale = others[bit] != nullptr ? 2.0 : 1.0;
        const double threshold = others[bit] != nullptr ? static_cast<double>(others[bit][i]) : mean[i];
        const double off = static_cast<double>(levels[bit][i]) - threshold;
        parity ^= off > 0.0 ? 1U : 0U;
        word = word << 1U | parity;
        if (std::abs(off) < scale * kDoubt * static_cast<double>(modulation[i])) ++doubts;
      }
      ASSERT_EQ(words[i], word);
      ASSERT_EQ(doubtful[i], doubts);
    }
  });
}

TEST(DecodeKernels, GrayCodesOfBytesAreRead) { read_gray_as_one_bit_after_the_other<std::uint8_t>(255); }
TEST(DecodeKernels, GrayCodesOfWordsAreRead) { read_gray_as_one_bit_after_the_other<std::uint16_t>(65535); }

TEST(DecodeKernels, PlacesWhereRowsDifferAreFound) {
  Random random(4);
  std::vector<std::uint16_t> a(kCount), b;
  for (auto& word : a) word = static_cast<std::uint16_t>(random.whole(0, 65535));
  b = a;
  std::vector<std::uint32_t> expected;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    if (random.whole(0, 9) > 0) continue;
    ++b[i];
    expected.push_back(i);
  }
  for_each_target([&] {
    std::vector<std::uint32_t> places(kCount);
    places.resize(differing(a.data(), b.data(), kCount, places.data()));
    EXPECT_EQ(places, expected);
  });
}

TEST(DecodeKernels, PhasesAreCorrectedAndPutOnTheCircle) {
  constexpr std::size_t kBins = 64;
  Random random(5);
  auto turns = random.floats(kCount, 0.0, 1.0);
  turns[0] = 0.0F;
  turns[1] = 0.99999994F;
  const auto correction = random.floats(kBins + 1, -0.02, 0.02);
  for_each_target([&] {
    std::vector<float> corrected = turns, cosine(kCount), sine(kCount);
    correct_turns(correction.data(), kBins, corrected.data(), kCount);
    point_on_circle(turns.data(), kCount, 6, cosine.data(), sine.data());
    for (std::size_t i = 0; i < kCount; ++i) {
      const double at = turns[i] * static_cast<double>(kBins);
      const auto bin = std::min(static_cast<std::size_t>(at), kBins - 1);
      const double rest = at - static_cast<double>(bin);
      const double off =
          static_cast<double>(corrected[i]) - static_cast<double>(turns[i]) -
          ((1.0 - rest) * static_cast<double>(correction[bin]) + rest * static_cast<double>(correction[bin + 1]));
      ASSERT_NEAR(off - std::round(off), 0.0, 1.5e-7);
      ASSERT_GE(corrected[i], 0.0F);
      ASSERT_LT(corrected[i], 1.0F);
      ASSERT_NEAR(cosine[i], std::cos(12.0 * std::numbers::pi * turns[i]), 4e-6);
      ASSERT_NEAR(sine[i], std::sin(12.0 * std::numbers::pi * turns[i]), 4e-6);
    }
  });
}

TEST(DecodeKernels, WordsTellCoordinates) {
  Random random(6);
  const auto turns = random.floats(kCount, 0.0, 1.0);
  std::vector<std::uint16_t> words(kCount);
  std::vector<std::uint8_t> doubtful(kCount), status(kCount, 0);
  for (std::size_t i = 0; i < kCount; ++i) {
    words[i] = static_cast<std::uint16_t>(random.whole(0, 300));
    doubtful[i] = static_cast<std::uint8_t>(random.whole(0, 3));
    if (random.whole(0, 9) == 0) status[i] = 1;
  }
  const WordScale scale{0.5F, 0.25F, 0.4F};
  for_each_target([&] {
    std::vector<float> coordinates(kCount);
    std::vector<std::uint8_t> asked = doubtful;
    read_coordinates(scale, words.data(), turns.data(), status.data(), kCount, asked.data(), coordinates.data());
    for (std::size_t i = 0; i < kCount; ++i) {
      const double off = 0.5 * words[i] + 0.25 - static_cast<double>(turns[i]);
      const bool near = std::abs(off - std::round(off)) <= 0.4;
      const bool told = status[i] == 0 && doubtful[i] <= 1 && near;
      ASSERT_EQ(std::isnan(coordinates[i]), !told);
      if (told) {
        ASSERT_NEAR(coordinates[i], std::round(off) + static_cast<double>(turns[i]), 2e-5);
      }
      const int question = status[i] != 0 ? 0 : doubtful[i] > 1 ? 2 : doubtful[i] == 1 || !near ? 1 : 0;
      ASSERT_EQ(asked[i], question);
    }
  });
}

TEST(DecodeKernels, EndsOfSurfacesAreMarked) {
  constexpr int kHeight = 9;
  Random random(7);
  std::vector<float> turns(kCount * kHeight), sigma = random.floats(kCount * kHeight, 0.001, 0.004);
  const auto at = [](int x, int y) { return static_cast<std::size_t>(y) * kCount + static_cast<std::size_t>(x); };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < static_cast<int>(kCount); ++x) {
      const double bend = 0.02 * std::max(0, x - 60) + (x > 100 ? 1.0 : 0.0) + (y > 4 ? 0.03 * (y - 4) : 0.0);
      turns[at(x, y)] = random.whole(0, 30) == 0 ? kNowhere : static_cast<float>(0.05 * x + 0.02 * y + bend);
    }
  }
  for (const bool creases : {true, false}) {
    const SurfaceLimits limits{0.2F, 6.0F, 0.01F, 5.0F, creases};
    for_each_target([&] {
      int marked = 0;
      for (int y = 0; y < kHeight; ++y) {
        std::vector<char> bad(kCount, 0);
        bad[17] = 1;
        mark_ends(limits, &turns[at(0, y)], &sigma[at(0, y)], kCount, y, kHeight - 1 - y, bad.data());
        for (int x = 0; x < static_cast<int>(kCount); ++x) {
          bool ends = x == 17;
          for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}}) {
            const auto inside = [&, dx = dx, dy = dy](int k) {
              return x + k * dx >= 0 && x + k * dx < static_cast<int>(kCount) && y + k * dy >= 0 && y + k * dy < kHeight;
            };
            const auto there = [&, dx = dx, dy = dy](int k) { return at(x + k * dx, y + k * dy); };
            if (inside(1))
              ends = ends ||
                     std::abs(turns[there(0)] - turns[there(1)]) > 0.2F + 6.0F * std::max(sigma[there(0)], sigma[there(1)]);
            if (!creases || !inside(3) || !inside(-3) || std::isnan(turns[there(0)])) continue;
            const float change = 0.5F * (turns[there(3)] - turns[there(1)] - turns[there(-1)] + turns[there(-3)]);
            ends = ends || std::abs(change) > 0.01F + 5.0F * std::max({sigma[there(-1)], sigma[there(0)], sigma[there(1)]});
          }
          ASSERT_EQ(bad[static_cast<std::size_t>(x)] != 0, ends) << x << " " << y;
          marked += ends ? 1 : 0;
        }
      }
      EXPECT_GT(marked, 20);
      EXPECT_LT(marked, 600);
    });
  }
}

TEST(DecodeKernels, MarksOfRowsAreJoinedAndLargestSigmasFound) {
  Random random(8);
  std::array<std::vector<char>, 4> rows;
  std::vector<std::uint8_t> status(kCount);
  for (auto& row : rows) {
    row.resize(kCount);
    for (char& mark : row) mark = random.whole(0, 5) == 0;
  }
  for (auto& one : status) one = static_cast<std::uint8_t>(random.whole(0, 2));
  const auto sigma = random.floats(kCount, 0.0, 1.0);
  const std::array<const char*, 4> begins = {rows[0].data(), rows[1].data(), rows[2].data(), rows[3].data()};
  for_each_target([&] {
    std::vector<char> all(kCount);
    any_marked(begins.data(), begins.size(), kCount, all.data());
    float largest = 0.0F;
    for (std::size_t i = 0; i < kCount; ++i) {
      ASSERT_EQ(all[i] != 0, rows[0][i] || rows[1][i] || rows[2][i] || rows[3][i]);
      if (status[i] == 0) largest = std::max(largest, sigma[i]);
    }
    EXPECT_EQ(largest_valid(status.data(), sigma.data(), kCount), largest);
  });
}

TEST(DecodeKernels, PhasesLeanOnBrightness) {
  constexpr std::size_t kHeight = 7;
  Random random(9);
  auto turns = random.floats(kCount * kHeight, 0.0, 1.0);
  const auto b = random.floats(kCount * kHeight, 10.0, 20.0);
  const auto sigma = random.floats(kCount, 0.0, 0.01);
  const std::size_t row = 3 * kCount;
  std::vector<char> surface(kCount, 1);
  for (std::size_t i = 0; i < kCount; i += 5) surface[i] = 0;
  for (const bool missing : {false, true}) {
    if (missing) turns[row + 70] = kNowhere;
    for_each_target([&] {
      std::vector<float> lean(kCount, kNowhere);
      EXPECT_EQ(lean_row(&turns[row], &b[row], kCount, 12.0F, lean.data()), missing);
      const auto slope = [&](std::size_t i, std::size_t stride) {
        double sum = 0.0;
        for (std::size_t k = 1; k <= 3; ++k) {
          sum += static_cast<double>(k) * (static_cast<double>(turns[i + k * stride]) - turns[i - k * stride]) / 28.0;
        }
        return sum;
      };
      const auto derivative = [&](std::size_t i, std::size_t stride) {
        const auto across = [&](std::size_t k) { return static_cast<double>(b[i + k * stride]) - b[i - k * stride]; };
        return 0.75 * across(1) - 0.15 * across(2) + across(3) / 60.0;
      };
      std::vector<std::uint32_t> expected;
      for (std::size_t x = 3; x + 3 < kCount; ++x) {
        const std::size_t i = row + x;
        const double value = (slope(i, 1) * derivative(i, 1) + slope(i, kCount) * derivative(i, kCount)) / b[i];
        if (b[i] < 12.0F || std::isnan(value)) {
          ASSERT_TRUE(std::isnan(lean[x]));
          continue;
        }
        ASSERT_NEAR(lean[x], value, 1e-5);
        if (surface[x] != 0 && std::abs(lean[x]) >= 2.0F * sigma[x]) expected.push_back(static_cast<std::uint32_t>(x));
      }
      std::vector<std::uint32_t> places(kCount);
      places.resize(leaning_places(lean.data(), sigma.data(), surface.data(), 2.0F, kCount, places.data()));
      EXPECT_EQ(places, expected);
    });
  }
}

template <typename Sample>
void compare_images_exactly(int white) {
  Random random(10);
  std::array<std::vector<Sample>, 6> rows;
  for (auto& row : rows) {
    row.resize(kCount);
    for (Sample& level : row) level = static_cast<Sample>(random.whole(0, white));
  }
  const double limit = 0.9 * white;
  ShiftSums expected;
  for (std::size_t i = 1; i + 1 < kCount; ++i) {
    const auto level = [&](std::size_t row, std::size_t k) { return static_cast<double>(rows[row][k]); };
    const double h = level(1, i), d = level(4, i) - h;
    if (h >= limit || level(4, i) >= limit) continue;
    const double x = level(1, i + 1) - level(1, i - 1) + level(4, i + 1) - level(4, i - 1);
    const double y = level(2, i) - level(0, i) + level(5, i) - level(3, i);
    expected.xx += x * x, expected.xy += x * y, expected.yy += y * y;
    expected.xh += x * h, expected.yh += y * h, expected.hh += h * h;
    expected.x += x, expected.y += y, expected.h += h;
    expected.dx += d * x, expected.dy += d * y, expected.dh += d * h;
    expected.d += d, expected.dd += d * d, expected.count += 1.0;
  }
  for_each_target([&] {
    ShiftSums sums;
    add_shift_sums(ThreeRows<Sample>{rows[0].data(), rows[1].data(), rows[2].data()},
                   ThreeRows<Sample>{rows[3].data(), rows[4].data(), rows[5].data()}, 1, kCount - 1, limit, sums);
    for (const auto part : {&ShiftSums::xx, &ShiftSums::xy, &ShiftSums::yy, &ShiftSums::xh, &ShiftSums::yh, &ShiftSums::hh,
                            &ShiftSums::x, &ShiftSums::y, &ShiftSums::h, &ShiftSums::dx, &ShiftSums::dy, &ShiftSums::dh,
                            &ShiftSums::d, &ShiftSums::dd, &ShiftSums::count}) {
      EXPECT_EQ(sums.*part, expected.*part);
    }
  });
}

TEST(DecodeKernels, ShiftsOfBytesAreSummedExactly) { compare_images_exactly<std::uint8_t>(255); }
TEST(DecodeKernels, ShiftsOfWordsAreSummedExactly) { compare_images_exactly<std::uint16_t>(65535); }

}  // namespace
}  // namespace crosstie::scan::detail
