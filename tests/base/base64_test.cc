#include "base/base64.h"

#include <string>

#include <gtest/gtest.h>

namespace crosstie::base {
namespace {

// The vectors of RFC 4648, section 10, and bytes that give + and /.
TEST(Base64, PublishedVectors) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xfb\xff\xfe\0", 4)), "+//+AA==");
}

}  // namespace
}  // namespace crosstie::base
