#include "base/envelope_reader.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;

ResultEnvelope some_envelope() {
  return {.verb = "edge",
          .frame = "machine",
          .inputs = {{"stitch/result.json", "0f"}},
          .verdicts = {{"gap", 3.0, 50.0, "mm", "job", VerdictLevel::kWarning},
                       {"rms", NAN, 1.0, "", "default", VerdictLevel::kFail}},
          .warnings = {{"gap", "hole", "a shadow"}}};
}

TEST(ReadEnvelope, ReturnsWhatWasWritten) {
  const tests::TemporaryFolder folder;
  folder.write("result.json", result_json(some_envelope(), nullptr, {{"length_mm", 3.0}}).dump());
  const auto read = read_envelope(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->verb, "edge");
  EXPECT_EQ(read->frame, "machine");
  ASSERT_EQ(read->inputs.size(), 1U);
  EXPECT_EQ(read->inputs[0].path, "stitch/result.json");
  ASSERT_EQ(read->verdicts.size(), 2U);
  EXPECT_EQ(read->verdicts[0].level, VerdictLevel::kWarning);
  EXPECT_EQ(read->verdicts[0].limit, 50.0);
  EXPECT_TRUE(std::isnan(read->verdicts[1].value));
  ASSERT_EQ(read->warnings.size(), 1U);
  EXPECT_EQ(read->warnings[0].message, "a shadow");
}

TEST(ReadEnvelope, RefusesWhatIsNoResult) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(read_envelope(folder.path()).error().code, ErrorCode::kFileSystem);
  for (const char* text : {"{", "[]", "{\"verb\": \"edge\"}", "{\"verb\": 3}"}) {
    folder.write("result.json", text);
    const auto read = read_envelope(folder.path());
    ASSERT_FALSE(read) << text;
    EXPECT_EQ(read.error().code, ErrorCode::kBadInput) << text;
    EXPECT_THAT(read.error().message, HasSubstr("result.json"));
  }
  auto json = result_json(some_envelope(), nullptr, nlohmann::ordered_json::object());
  json["verdicts"][0]["level"] = "GOOD";
  folder.write("result.json", json.dump());
  EXPECT_THAT(read_envelope(folder.path()).error().message, HasSubstr("\"GOOD\""));
}

}  // namespace
}  // namespace crosstie::base
