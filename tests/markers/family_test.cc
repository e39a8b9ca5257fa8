#include "markers/family.h"

#include <fstream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/measured_data.h"

namespace crosstie::markers {
namespace {

std::uint64_t rotated(std::uint64_t ring, int by, int bits) {
  for (int i = 0; i < by; ++i) ring = ((ring << 1) | (ring >> (bits - 1))) & ((std::uint64_t{1} << bits) - 1U);
  return ring;
}

TEST(MarkerFamily, HasThePublishedNumbersOfCodes) {
  const std::map<std::string, std::size_t> published = {{"ring10", 54},      {"aicon12", 147},    {"aicon14", 516},
                                                        {"aicon20", 24793},  {"agisoft12", 161},  {"agisoft14", 561},
                                                        {"agisoft16", 2001}, {"agisoft20", 26013}};
  std::map<std::string, std::size_t> counts;
  for (const std::string& name : marker_family_names()) {
    if (!name.starts_with("apriltag:")) counts[name] = marker_family(name)->codes.size();
  }
  EXPECT_EQ(counts, published);
}

TEST(MarkerFamily, Ring10CodesAreStartSequenceAndGrayCode) {
  const MarkerFamily family = *marker_family("ring10");
  for (const MarkerCode& code : family.codes) {
    EXPECT_EQ(code.code >> 7, 0b110U);
    std::uint64_t n = 0;  // Gray code back to the number, bit by bit
    for (int bit = 6; bit >= 0; --bit) n = (n << 1) | (((code.code >> bit) ^ n) & 1U);
    EXPECT_EQ(static_cast<int>(n), code.id);
  }
  EXPECT_EQ(family.codes.front().id, 0);
}

/// The published list of the 12-bit targets: how it begins and where it ends.
TEST(MarkerFamily, Agisoft12BeginsAndEndsAsPublished) {
  const MarkerFamily family = *marker_family("agisoft12");
  const std::vector<std::uint64_t> first = {71, 75, 77, 83};
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(family.codes[i].code, first[i]);
  EXPECT_EQ(family.codes.back().code, 2015U);
  EXPECT_EQ(family.codes.back().id, 161);
}

/// Numbers of codes that the AprilTag authors publish, and the first code of the most used family.
TEST(MarkerFamily, AprilTagsAreThoseOfTheLibrary) {
  const std::map<std::string, std::size_t> published = {
      {"tag16h5", 30}, {"tag25h9", 35}, {"tag36h11", 587}, {"tagCircle21h7", 38}, {"tagStandard41h12", 2115}};
  for (const auto& [name, count] : published) {
    const auto family = marker_family("apriltag:" + name);
    ASSERT_TRUE(family) << name;
    EXPECT_EQ(family->name, "apriltag:" + name);
    EXPECT_EQ(family->codes.size(), count) << name;
    EXPECT_EQ(family->codes.front().id, 0);
    EXPECT_TRUE(family->tag);
  }
  EXPECT_EQ(marker_family("apriltag:tag36h11")->code_of(0), 0xd7e00984bU);
  EXPECT_EQ(marker_family("apriltag:tag36h11")->code_of(587), std::nullopt);
  EXPECT_THAT(marker_family("apriltag:tag36h12").error().message, testing::HasSubstr("did you mean \"apriltag:tag36h1"));
}

TEST(MarkerFamily, EveryCodeIsFoundFromEveryRotation) {
  for (const char* name : {"ring10", "aicon12", "aicon14", "agisoft12", "agisoft14", "agisoft16"}) {
    const MarkerFamily family = *marker_family(name);
    std::set<int> ids;
    for (const MarkerCode& code : family.codes) {
      EXPECT_TRUE(ids.insert(code.id).second);
      for (int by = 0; by < family.bits; ++by) {
        EXPECT_EQ(family.id_of_ring(rotated(code.code, by, family.bits)), code.id) << name;
      }
    }
  }
}

TEST(MarkerFamily, RingsThatAreNoCodeHaveNoId) {
  const MarkerFamily family = *marker_family("aicon14");
  EXPECT_EQ(family.id_of_ring(0), std::nullopt);
  EXPECT_EQ(family.id_of_ring((1U << 14) - 1U), std::nullopt);
  for (const MarkerCode& code : family.codes) EXPECT_EQ(family.id_of_ring(code.code ^ 1U), std::nullopt);  // odd
  // 3 = two neighbours: even, but no opposite pair.
  EXPECT_EQ(family.id_of_ring(3), std::nullopt);
}

TEST(MarkerFamily, AiconIdsEqualAiconsTables) {
  const auto folder = tests::measured_data("aicon-panel");
  if (folder.empty()) GTEST_SKIP() << "no aicon-panel in CROSSTIE_DATA";
  for (const int bits : {12, 14, 20}) {
    const MarkerFamily family = *marker_family("aicon" + std::to_string(bits));
    std::ifstream table(folder / "aicon_lookup" / (std::to_string(bits) + "bit_lookup.txt"));
    std::size_t rows = 0;
    int id = 0;
    std::uint32_t code = 0;
    while (table >> id >> code) {
      ASSERT_LT(rows, family.codes.size());
      ASSERT_EQ(family.codes[rows].id, id);
      ASSERT_EQ(family.codes[rows].code, code);
      ++rows;
    }
    EXPECT_EQ(rows, family.codes.size());
  }
}

TEST(MarkerFamily, UnknownNamesAreRefusedWithTheNearestOne) {
  const auto family = marker_family("aicon41");
  ASSERT_FALSE(family);
  EXPECT_EQ(family.error().code, base::ErrorCode::kUsage);
  EXPECT_THAT(family.error().message, testing::HasSubstr("did you mean \"aicon"));
  EXPECT_THAT(family.error().message, testing::HasSubstr("ring10"));
}

}  // namespace
}  // namespace crosstie::markers
