#include "report/verdict_words.h"

#include <gtest/gtest.h>

namespace crosstie::report {
namespace {

TEST(VerdictWords, KeysOfResultsBecomeWordsWithWhatTheyAreOf) {
  EXPECT_EQ(verdict_words("sigma0_px"), "sigma of an image coordinate (sigma0)");
  EXPECT_EQ(verdict_words("heldout_rms_px left"), "residual of board images left out, rms per point, left");
}

TEST(VerdictWords, WhatIsNoKeyStaysAsItIs) {
  for (const char* name : {"off the epipolar curves", "largest gap of the rim", "", " "}) EXPECT_EQ(verdict_words(name), name);
}

}  // namespace
}  // namespace crosstie::report
