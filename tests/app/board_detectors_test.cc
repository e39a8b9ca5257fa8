// Which detector's corners a calibration takes.
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "app/steps_calibrate.h"

namespace crosstie::app {
namespace {

FoundCorners found_in(const std::string& detector, int images, bool sample = false) {
  FoundCorners found{detector, std::vector<base::BoardImage>(30), sample};
  for (int i = 0; i < images; ++i) found.images[static_cast<std::size_t>(i)].corners.push_back({});
  return found;
}

std::string used(std::vector<FoundCorners> found) {
  put_best_first(found);
  return found.front().detector;
}

TEST(BoardDetectors, TheFirstIsUsedUnlessAnotherFindsTheBoardFarMoreOften) {
  EXPECT_EQ(used({found_in("classic", 15), found_in("sb", 15)}), "classic");
  EXPECT_EQ(used({found_in("classic", 15), found_in("sb", 16)}), "classic")
      << "one image more is not worth corners that are worse";
  EXPECT_EQ(used({found_in("classic", 15), found_in("sb", 20)}), "classic");
  EXPECT_EQ(used({found_in("classic", 15), found_in("sb", 21)}), "sb");
  EXPECT_EQ(used({found_in("classic", 0), found_in("sb", 1)}), "sb");
  EXPECT_EQ(used({found_in("classic", 2), found_in("sb", 8, true)}), "classic") << "a sample is for comparison";
  EXPECT_EQ(used({found_in("circles", 0)}), "circles");
}

}  // namespace
}  // namespace crosstie::app
