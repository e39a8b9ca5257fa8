// The window on SDL's dummy screen, whose pixels can be read back.
#include "devices/window_sequencer.h"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <SDL.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/host_time.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;

/// The smallest sequence that unwraps itself, of a given size.
base::PatternSequence sequence_of(int width_px, int height_px) {
  base::PatternSequence sequence;
  sequence.width_px = width_px;
  sequence.height_px = height_px;
  sequence.x.fringes = {1.0};
  sequence.patterns = {{.kind = base::PatternKind::kWhite}, {.kind = base::PatternKind::kBlack}};
  for (int k = 0; k < 3; ++k) sequence.patterns.push_back({.kind = base::PatternKind::kFringe, .shift = k / 3.0});
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    const std::string name = fmt::format("{:02}.png", i);
    sequence.patterns[i].files = {name, name};
  }
  return sequence;
}

/// No two neighbours, rows or patterns are alike; all grey levels occur.
int grey(int x, int y, std::size_t pattern) { return (x + 3 * y + 37 * static_cast<int>(pattern)) % 256; }

std::vector<base::Image> images_of(const base::PatternSequence& sequence) {
  std::vector<base::Image> images;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    base::Image image(sequence.width_px, sequence.height_px, 8);
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(grey(x, y, i));
    }
    images.push_back(std::move(image));
  }
  return images;
}

class WindowSequencerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ::setenv("SDL_VIDEODRIVER", "dummy", 1);
    const auto screens = list_screens();
    ASSERT_TRUE(screens) << screens.error().message;
    ASSERT_EQ(screens->size(), 1u);
    screen_ = screens->front();
    sequence_ = sequence_of(screen_.width_px, screen_.height_px);
  }
  std::unique_ptr<WindowSequencer> open(int settle_refreshes = 0) {
    auto opened = WindowSequencer::open({.screen = 0, .settle_refreshes = settle_refreshes});
    EXPECT_TRUE(opened) << opened.error().message;
    return opened ? *std::move(opened) : nullptr;
  }
  static void send(SDL_Event event) { ASSERT_EQ(SDL_PushEvent(&event), 1); }
  static void expect_pattern(WindowSequencer& projector, std::size_t pattern) {
    const auto picture = projector.picture();
    ASSERT_TRUE(picture) << picture.error().message;
    for (int y = 0; y < picture->height(); ++y) {
      for (int x = 0; x < picture->width(); ++x)
        ASSERT_EQ(picture->view().row<std::uint8_t>(y)[x], grey(x, y, pattern)) << x << ", " << y << " of " << pattern;
    }
  }

  Screen screen_;
  base::PatternSequence sequence_;
};

TEST_F(WindowSequencerTest, ShowsEveryPixelOfEachPatternInOrder) {
  const auto projector = open();
  EXPECT_EQ(projector->picture().error().code, ErrorCode::kDevice);  // nothing is uploaded
  const auto uploaded = projector->upload(sequence_, images_of(sequence_));
  ASSERT_TRUE(uploaded) << uploaded.error().message;
  const auto black = projector->picture();
  ASSERT_TRUE(black);
  EXPECT_EQ(black->width(), screen_.width_px);
  EXPECT_EQ(black->view().row<std::uint8_t>(7)[9], 0);
  for (int capture = 0; capture < 2; ++capture) {
    ASSERT_TRUE(projector->arm());
    for (std::size_t i = 0; i < sequence_.patterns.size(); ++i) {
      const auto stepped = projector->step();
      ASSERT_TRUE(stepped) << stepped.error().message;
      EXPECT_EQ(*stepped, i);
      expect_pattern(*projector, i);
    }
    EXPECT_EQ(projector->status().phase, SequencerPhase::kFinished);
  }
}

TEST_F(WindowSequencerTest, StepWaitsUntilThePictureHasSettled) {
  const double refresh_hz = screen_.refresh_hz > 0.0 ? screen_.refresh_hz : 60.0;
  constexpr int kRefreshes = 12;
  const auto projector = open(kRefreshes);
  ASSERT_TRUE(projector->upload(sequence_, images_of(sequence_)));
  ASSERT_TRUE(projector->arm());
  for (int i = 0; i < 3; ++i) {
    const HostTime before = host_now();
    ASSERT_TRUE(projector->step());
    EXPECT_GE(seconds_between(before, host_now()), kRefreshes / refresh_hz);
  }
}

TEST_F(WindowSequencerTest, PatternsOfAnotherSizeAreRefusedWithBothSizes) {
  const auto projector = open();
  const base::PatternSequence other = sequence_of(64, 48);
  const auto refused = projector->upload(other, images_of(other));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(refused.error().message, HasSubstr("64 x 48 px"));
  EXPECT_THAT(refused.error().message, HasSubstr(fmt::format("{} x {} px", screen_.width_px, screen_.height_px)));
  EXPECT_EQ(projector->arm().error().code, ErrorCode::kUsage);
  EXPECT_TRUE(projector->upload(sequence_, images_of(sequence_)));
}

TEST_F(WindowSequencerTest, AWindowThatIsLostIsToldOfAndOpenedAgain) {
  SDL_Event quit{};
  quit.type = SDL_QUIT;
  SDL_Event unplugged{};
  unplugged.type = SDL_DISPLAYEVENT;
  unplugged.display.event = SDL_DISPLAYEVENT_DISCONNECTED;
  const auto projector = open();
  for (const auto& [event, words] : {std::pair{quit, "closed"}, {unplugged, "disconnected"}}) {
    ASSERT_TRUE(projector->upload(sequence_, images_of(sequence_)));
    ASSERT_TRUE(projector->arm());
    ASSERT_TRUE(projector->step());
    send(event);
    const auto lost = projector->step();
    ASSERT_FALSE(lost) << words;
    EXPECT_EQ(lost.error().code, ErrorCode::kDevice);
    EXPECT_THAT(lost.error().message, HasSubstr(words));
    EXPECT_THAT(projector->status().trouble, HasSubstr(words));
    EXPECT_THAT(projector->step().error().message, HasSubstr(words));  // it stays lost
  }
  // Somebody else's screen.
  ASSERT_TRUE(projector->upload(sequence_, images_of(sequence_)));
  ASSERT_TRUE(projector->arm());
  unplugged.display.display = 5;
  send(unplugged);
  ASSERT_TRUE(projector->step());
  expect_pattern(*projector, 0);
  projector->close();
  EXPECT_EQ(projector->step().error().code, ErrorCode::kDevice);
}

TEST_F(WindowSequencerTest, OneWindowAtATimeOnAScreenThatIsThere) {
  const auto none = WindowSequencer::open({.screen = 3});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kDevice);
  EXPECT_THAT(none.error().message, HasSubstr("no screen 3"));
  EXPECT_THAT(none.error().message, HasSubstr(fmt::format("{} x {} px", screen_.width_px, screen_.height_px)));
  EXPECT_EQ(WindowSequencer::open({.screen = -1}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(WindowSequencer::open({.settle_refreshes = -1}).error().code, ErrorCode::kUsage);
  auto first = open();
  EXPECT_EQ(WindowSequencer::open({.screen = 0}).error().code, ErrorCode::kUsage);
  EXPECT_TRUE(list_screens());  // beside it
  first.reset();
  EXPECT_TRUE(open());
}

TEST_F(WindowSequencerTest, WithoutADesktopItSaysSo) {
  ::setenv("SDL_VIDEODRIVER", "no such driver", 1);
  const auto opened = WindowSequencer::open({.screen = 0});
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kDevice);
  EXPECT_THAT(opened.error().message, HasSubstr("no desktop"));
  EXPECT_FALSE(list_screens());
}

}  // namespace
}  // namespace crosstie::devices
