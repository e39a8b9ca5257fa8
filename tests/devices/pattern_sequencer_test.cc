#include "devices/pattern_sequencer.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWidth = 64, kHeight = 48;

/// White, black and three sets of one fringe in three steps each: the smallest sequence that unwraps itself.
base::PatternSequence small_sequence() {
  base::PatternSequence sequence;
  sequence.width_px = kWidth;
  sequence.height_px = kHeight;
  sequence.x.fringes = {1.0};
  sequence.patterns = {{.kind = base::PatternKind::kWhite}, {.kind = base::PatternKind::kBlack}};
  for (int k = 0; k < 3; ++k) sequence.patterns.push_back({.kind = base::PatternKind::kFringe, .shift = k / 3.0});
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    const std::string name = fmt::format("{:02}.png", i);
    sequence.patterns[i].files = {name, name};
  }
  return sequence;
}

/// Images of one grey level each: 10, 11, 12, ...
std::vector<base::Image> images_of(const base::PatternSequence& sequence) {
  std::vector<base::Image> images;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    base::Image image(kWidth, kHeight, 8);
    for (int y = 0; y < kHeight; ++y) std::fill_n(image.row<std::uint8_t>(y), kWidth, static_cast<std::uint8_t>(10 + i));
    images.push_back(std::move(image));
  }
  return images;
}

int grey_of(const base::Image& image) { return image.view().row<std::uint8_t>(kHeight - 1)[kWidth - 1]; }

TEST(SimulatedSequencer, ShowsEachPatternOnceInOrder) {
  std::vector<int> shown;
  SimulatedSequencer projector(
      [&](std::size_t index, const base::Pattern& pattern, const base::Image& image) -> base::Result<> {
        EXPECT_EQ(pattern.files[0], fmt::format("{:02}.png", index));
        shown.push_back(grey_of(image));
        return {};
      });
  EXPECT_EQ(projector.status().phase, SequencerPhase::kEmpty);
  ASSERT_TRUE(projector.upload(small_sequence(), images_of(small_sequence())));
  EXPECT_EQ(projector.status().phase, SequencerPhase::kUploaded);
  for (int capture = 0; capture < 2; ++capture) {
    shown.clear();
    ASSERT_TRUE(projector.arm());
    EXPECT_EQ(projector.status().phase, SequencerPhase::kArmed);
    EXPECT_TRUE(shown.empty());
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(*projector.step(), i);
      EXPECT_EQ(projector.status().shown, i + 1);
      EXPECT_EQ(projector.status().phase, i == 4 ? SequencerPhase::kFinished : SequencerPhase::kShowing);
    }
    EXPECT_THAT(shown, ElementsAre(10, 11, 12, 13, 14));
    EXPECT_EQ(projector.step().error().code, ErrorCode::kUsage);
    EXPECT_EQ(shown.size(), 5u);
  }
}

TEST(SimulatedSequencer, APatternThatFailedIsShownAgain) {
  bool lamp = true;
  std::vector<std::size_t> shown;
  SimulatedSequencer projector([&](std::size_t index, const base::Pattern&, const base::Image&) -> base::Result<> {
    if (!lamp) return base::fail(ErrorCode::kDevice, "the lamp is off");
    shown.push_back(index);
    return {};
  });
  ASSERT_TRUE(projector.upload(small_sequence(), images_of(small_sequence())));
  ASSERT_TRUE(projector.arm());
  ASSERT_TRUE(projector.step());
  lamp = false;
  EXPECT_EQ(projector.step().error().code, ErrorCode::kDevice);
  EXPECT_THAT(projector.status().trouble, HasSubstr("lamp"));
  EXPECT_EQ(projector.status().shown, 1u);
  lamp = true;
  EXPECT_EQ(*projector.step(), 1u);
  EXPECT_EQ(projector.status().trouble, "");
  EXPECT_THAT(shown, ElementsAre(0u, 1u));
}

TEST(SimulatedSequencer, TheOrderOfCallsIsKept) {
  SimulatedSequencer projector([](std::size_t, const base::Pattern&, const base::Image&) -> base::Result<> { return {}; });
  EXPECT_EQ(projector.arm().error().code, ErrorCode::kUsage);
  EXPECT_EQ(projector.step().error().code, ErrorCode::kUsage);
  ASSERT_TRUE(projector.upload(small_sequence(), images_of(small_sequence())));
  EXPECT_THAT(projector.step().error().message, HasSubstr("uploaded"));
}

TEST(SimulatedSequencer, ImagesThatDoNotFitAreRefusedAndLeaveNothing) {
  SimulatedSequencer projector([](std::size_t, const base::Pattern&, const base::Image&) -> base::Result<> { return {}; });
  const base::PatternSequence sequence = small_sequence();
  ASSERT_TRUE(projector.upload(sequence, images_of(sequence)));
  std::vector<base::Image> fewer = images_of(sequence), other_size = fewer, other_bits = fewer;
  fewer.pop_back();
  other_size[3] = base::Image(kWidth + 1, kHeight, 8);
  other_bits[4] = base::Image(kWidth, kHeight, 16);
  for (const auto& images : {fewer, other_size, other_bits}) {
    const auto refused = projector.upload(sequence, images);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
    EXPECT_EQ(projector.status().phase, SequencerPhase::kEmpty);
    EXPECT_NE(projector.status().trouble, "");
  }
}

TEST(FileSequencer, WritesImagesAndManifestForOtherSoftware) {
  const tests::TemporaryFolder folder;
  FileSequencer projector(folder / "to/show");
  const base::PatternSequence sequence = small_sequence();
  ASSERT_TRUE(projector.upload(sequence, images_of(sequence)));
  const auto manifest = base::read_pattern_manifest(folder / "to/show/patterns.json");
  ASSERT_TRUE(manifest) << manifest.error().message;
  ASSERT_EQ(manifest->patterns.size(), 5u);
  EXPECT_EQ(manifest->width_px, kWidth);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto image = base::read_image(folder / "to/show" / manifest->patterns[i].files[0]);
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(grey_of(*image), static_cast<int>(10 + i));
  }
  ASSERT_TRUE(projector.arm());
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(*projector.step(), i);
  EXPECT_EQ(projector.status().phase, SequencerPhase::kFinished);
}

TEST(FileSequencer, NamesStayWithinTheFolder) {
  const tests::TemporaryFolder folder;
  for (const std::string name : {"../out.png", "/tmp/out.png", "sub/out.png", "01.png", "out.bmp", ""}) {
    FileSequencer projector(folder / "show");
    base::PatternSequence sequence = small_sequence();
    sequence.patterns[0].files = {name, name};
    const auto refused = projector.upload(sequence, images_of(sequence));
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
    EXPECT_FALSE(std::filesystem::exists(folder / "show"));
  }
}

TEST(FileSequencer, AFolderThatCannotBeMadeIsAnError) {
  const tests::TemporaryFolder folder;
  FileSequencer projector(folder.write("file", "") / "show");
  const auto refused = projector.upload(small_sequence(), images_of(small_sequence()));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kFileSystem);
  EXPECT_EQ(projector.status().phase, SequencerPhase::kEmpty);
}

}  // namespace
}  // namespace crosstie::devices
