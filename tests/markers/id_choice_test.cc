#include "markers/id_choice.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::markers {
namespace {

std::string segments(std::uint64_t code, int bits) {
  std::string text;
  for (int i = bits - 1; i >= 0; --i) text += ((code >> i) & 1U) != 0 ? '1' : '0';
  return text;
}

/// Letter by letter.
int slow_distance(const std::string& a, std::string b) {
  int smallest = static_cast<int>(a.size());
  for (std::size_t turn = 0; turn < a.size(); ++turn) {
    int different = 0;
    for (std::size_t i = 0; i < a.size(); ++i) different += a[i] != b[i] ? 1 : 0;
    smallest = std::min(smallest, different);
    std::rotate(b.begin(), b.begin() + 1, b.end());
  }
  return smallest;
}

std::vector<int> all_ids(const MarkerFamily& family) {
  std::vector<int> ids;
  for (const MarkerCode& code : family.codes) ids.push_back(code.id);
  return ids;
}

int smallest_distance(const MarkerFamily& family, const std::vector<int>& ids) {
  int smallest = family.bits;
  for (const int a : ids) {
    for (const int b : ids) {
      if (a >= b) continue;
      const auto code = [&](int id) {
        return std::find_if(family.codes.begin(), family.codes.end(), [&](const MarkerCode& c) { return c.id == id; })->code;
      };
      smallest = std::min(smallest, slow_distance(segments(code(a), family.bits), segments(code(b), family.bits)));
    }
  }
  return smallest;
}

TEST(IdChoice, StatesTheDistanceThatTheIdsHave) {
  for (const char* name : {"ring10", "aicon12", "aicon14", "agisoft16", "aicon20"}) {
    const auto family = marker_family(name);
    for (const int count : {2, 5, 20, 50}) {
      const auto choice = choose_distant_ids(*family, all_ids(*family), count);
      ASSERT_TRUE(choice) << choice.error().message;
      EXPECT_EQ(static_cast<int>(choice->ids.size()), count);
      EXPECT_TRUE(std::is_sorted(choice->ids.begin(), choice->ids.end()));
      EXPECT_EQ(choice->smallest_distance, smallest_distance(*family, choice->ids)) << name << ' ' << count;
    }
  }
}

TEST(IdChoice, TwentyIdsLieAsFarApartAsIsKnownToBePossible) {
  // Best worst pair of 20 ids: 4 segments in families of 14 and 16, at least 6 in those of 20.
  const auto reached = [](const char* name) {
    const auto family = marker_family(name);
    return choose_distant_ids(*family, all_ids(*family), 20)->smallest_distance;
  };
  EXPECT_EQ(reached("aicon14"), 4);
  EXPECT_EQ(reached("agisoft16"), 4);
  EXPECT_GE(reached("aicon20"), 6);
  EXPECT_GE(reached("agisoft20"), 6);
  // Neighbours of ring10's Gray code differ in one segment; codes of the same parity differ in two.
  EXPECT_GE(reached("ring10"), 2);
}

TEST(IdChoice, WholeFamilyAndErrors) {
  const auto family = marker_family("agisoft20");
  const std::vector<int> pool = all_ids(*family);
  const auto all = choose_distant_ids(*family, pool, static_cast<int>(pool.size()));
  ASSERT_TRUE(all);
  EXPECT_EQ(all->ids, pool);
  EXPECT_EQ(all->smallest_distance, 2);
  EXPECT_FALSE(choose_distant_ids(*family, pool, 0));
  EXPECT_FALSE(choose_distant_ids(*family, pool, static_cast<int>(pool.size()) + 1));
  EXPECT_FALSE(choose_distant_ids(*family, std::vector<int>{1, 1}, 1));
  EXPECT_FALSE(choose_distant_ids(*family, std::vector<int>{0}, 1));
  const auto single = choose_distant_ids(*family, std::vector<int>{7}, 1);
  ASSERT_TRUE(single);
  EXPECT_EQ(single->ids, std::vector<int>{7});
}

}  // namespace
}  // namespace crosstie::markers
