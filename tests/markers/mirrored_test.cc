#include "markers/mirrored.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

/// What the detector says of one marker of each id, rendered directly or in a mirror.
base::ImageObservations observed(const MarkerFamily& family, const std::vector<int>& ids, bool mirrored,
                                 const std::vector<int>& in_use) {
  base::ImageObservations all;
  for (const int id : ids) {
    tests::MarkerScene scene;
    scene.family = family;
    scene.code = std::find_if(family.codes.begin(), family.codes.end(), [&](const auto& c) { return c.id == id; })->code;
    scene.mirrored = mirrored;
    scene.samples_per_px = 4;
    scene.roll_rad = 0.7 * id;
    if (family.tag) {
      scene.radius_px = 5.0;
      scene.dark_on_bright = true;
    }
    const auto found = detect(tests::photograph(scene, {1.0, 1}).view(), family, {.ids = in_use});
    EXPECT_TRUE(found);
    for (const base::Observation& one : found->observations) all.observations.push_back(one);
  }
  return all;
}

/// Ten ids whose mirror images are not among them, by letters rather than bits.
std::vector<int> handed_ids(const MarkerFamily& family) {
  const auto letters = [&](std::uint64_t code) {
    std::string text;
    for (int i = family.bits - 1; i >= 0; --i) text += ((code >> i) & 1U) != 0 ? '1' : '0';
    return text;
  };
  const auto same_ring = [](const std::string& a, const std::string& b) { return (a + a).find(b) != std::string::npos; };
  std::vector<int> ids;
  std::vector<std::string> rings;
  for (const MarkerCode& code : family.codes) {
    const std::string ring = letters(code.code);
    const std::string back(ring.rbegin(), ring.rend());
    if (same_ring(ring, back)) continue;
    if (std::any_of(rings.begin(), rings.end(), [&](const std::string& other) { return same_ring(other, back); })) continue;
    rings.push_back(ring);
    ids.push_back(code.id);
    if (ids.size() == 10) break;
  }
  return ids;
}

TEST(Mirrored, AListOfIdsTellsMirroredRings) {
  for (const char* name : {"ring10", "aicon14", "agisoft12"}) {
    const MarkerFamily family = *marker_family(name);
    const std::vector<int> ids = handed_ids(family);
    ASSERT_EQ(ids.size(), 10U);
    const base::ImageObservations direct = observed(family, ids, false, ids);
    EXPECT_EQ(mirror_warning(direct, family, ids), std::nullopt) << name;
    EXPECT_EQ(handedness(direct, family, ids).only_direct, 10);
    const base::ImageObservations mirrored = observed(family, ids, true, ids);
    for (const base::Observation& one : mirrored.observations) EXPECT_EQ(one.status, base::ObservationStatus::kRefused) << name;
    const auto warning = mirror_warning(mirrored, family, ids);
    ASSERT_TRUE(warning) << name;
    EXPECT_THAT(*warning, testing::HasSubstr("10 of 10"));
    // Nobody knows without a list, and ids that are simply not in use say nothing.
    EXPECT_EQ(mirror_warning(observed(family, ids, true, {}), family, {}), std::nullopt);
    const std::vector<int> others = {family.codes.back().id};
    EXPECT_EQ(mirror_warning(observed(family, ids, false, others), family, others), std::nullopt) << name;
  }
}

TEST(Mirrored, TagsTellByThemselves) {
  const MarkerFamily family = *marker_family("apriltag:tag36h11");
  const std::vector<int> ids = {3, 17, 99, 200};
  EXPECT_EQ(mirror_warning(observed(family, ids, false, {}), family, {}), std::nullopt);
  const auto warning = mirror_warning(observed(family, ids, true, {}), family, {});
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, testing::HasSubstr("4 of 4"));
}

}  // namespace
}  // namespace crosstie::markers
