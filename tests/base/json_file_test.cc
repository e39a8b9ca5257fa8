#include "base/json_file.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/npy.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;
using Json = nlohmann::ordered_json;

TEST(JsonFile, KeepsOrderAndEveryBitOfNumbers) {
  const TemporaryFolder folder;
  Json json;
  json["z"] = 0.1;
  json["a"] = {1.0 / 3.0, 1e-300, 12345678901234567.0, -0.0, 5};
  json["text"] = "\xC3\xBC \" \n";
  ASSERT_TRUE(write_json(folder / "a.json", json));
  const auto again = read_json(folder / "a.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(*again, json);
  EXPECT_EQ(again->begin().key(), "z");
  EXPECT_TRUE((*again)["a"][4].is_number_integer());
  const std::string text = tests::read_all(folder / "a.json");
  EXPECT_EQ(text.back(), '\n');
  EXPECT_THAT(text, HasSubstr("\n  \"z\": 0.1,\n"));
}

TEST(JsonFile, WhatIsNotFiniteOrNotUtf8IsWrittenAllTheSame) {
  const TemporaryFolder folder;
  Json json;
  json["nan"] = std::nan("");
  json["name"] =
      "\xff"
      "abc";
  ASSERT_TRUE(write_json(folder / "a.json", json));
  const auto again = read_json(folder / "a.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_TRUE((*again)["nan"].is_null());
}

TEST(JsonFile, RefusesWithTheLine) {
  const TemporaryFolder folder;
  const std::pair<std::string, const char*> cases[] = {
      {"{\"a\": 1,\n \"b\": }\n", "a.json:2:7:"},
      {"{\"a\": 1,\n\n \"b\": [1, 2\n", "a.json:4:"},
      {"", "a.json:1:1:"},
      {"{} {}", "a.json:1:4:"},
      {"{\"a\": 1, \"b\": {\"c\": 1, \"c\": 2}}", "\"c\" occurs twice"},
      {"{\"a\": NaN}", "a.json:1:"},
      {"{\"a\": 1e999}", "a.json"},
      {"{\"a\": \"\xff\"}", "a.json:1:"},
      {std::string(65, '[') + std::string(65, ']'), "nested deeper than 64"},
      {std::string(100000, '['), "nested deeper than 64"},
  };
  for (const auto& [text, message] : cases) {
    const auto json = read_json(folder.write("a.json", text));
    ASSERT_FALSE(json) << text;
    EXPECT_EQ(json.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(json.error().message, HasSubstr(message)) << text.substr(0, 60);
  }
  EXPECT_TRUE(read_json(folder.write("a.json", std::string(64, '[') + std::string(64, ']'))));
  EXPECT_TRUE(read_json(folder.write("a.json", "[{\"a\": 1}, {\"a\": 1}]"))) << "the same key in two objects";
}

TEST(Npy, IsWhatNumPyWrites) {
  // numpy.save of [[1, 2], [3, 4]] begins with these 128 bytes.
  std::string expected("\x93NUMPY\x01\x00\x76\x00", 10);
  expected += "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }";
  expected += std::string(128 - expected.size() - 1, ' ') + "\n";
  const TemporaryFolder folder;
  Eigen::MatrixXd matrix(2, 2);
  matrix << 1, 2, 3, 4;
  ASSERT_TRUE(write_npy(folder / "a.npy", matrix));
  const std::string bytes = tests::read_all(folder / "a.npy");
  ASSERT_EQ(bytes.size(), 128U + 32U);
  EXPECT_EQ(bytes.substr(0, 128), expected);
  EXPECT_EQ(bytes.substr(128 + 8, 8), std::string("\0\0\0\0\0\0\0@", 8)) << "2 follows 1: row by row";
}

TEST(Npy, ReadsBothOrders) {
  const TemporaryFolder folder;
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(7, 5);
  ASSERT_TRUE(write_npy(folder / "a.npy", matrix));
  EXPECT_EQ(*read_npy(folder / "a.npy"), matrix);
  std::string bytes = tests::read_all(folder / "a.npy");
  const auto at = bytes.find("False");
  bytes.replace(at, 5, "True ");
  bytes.replace(bytes.find("(7, 5)"), 6, "(5, 7)");
  EXPECT_EQ(*read_npy(folder.write("f.npy", bytes)), matrix.transpose());
}

TEST(Npy, RefusesOtherShapesAndTypes) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_npy(folder / "a.npy", Eigen::MatrixXd::Identity(4, 4)));
  const std::string good = tests::read_all(folder / "a.npy");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    return bytes.replace(bytes.find(from), from.size(), to);
  };
  std::string nan = good;
  nan.replace(128, 8, std::string("\0\0\0\0\0\0\xf8\x7f", 8));
  for (const std::string& bytes :
       {with("(4, 4)", "(4, 5)"), with("(4, 4)", "(4,-4)"), with("(4, 4)", "(16,) "), with("<f8", "<f4"), with("<f8", ">f8"),
        with("(4, 4)", "(99999999999, 99999999999)"), with("NUMPY\x01", "NUMPY\x02"), good + "x", nan}) {
    const auto matrix = read_npy(folder.write("b.npy", bytes));
    ASSERT_FALSE(matrix);
    EXPECT_EQ(matrix.error().code, ErrorCode::kBadInput);
  }
}

TEST(Npy, CovarianceKeepsItsLabels) {
  const TemporaryFolder folder;
  LabelledCovariance covariance{Eigen::Vector3d(1, 2, 3).asDiagonal(),
                                {"camera a fx [px]", "image b rx [rad]", "point 11 x [mm]"}};
  ASSERT_TRUE(write_covariance(folder.path(), covariance));
  const auto again = read_covariance(folder.path());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->labels, covariance.labels);
  EXPECT_EQ(again->matrix, covariance.matrix);
  const auto json = read_json(folder / "covariance.json");
  EXPECT_EQ((*json)["units"], Json::parse(R"(["px", "rad", "mm"])"));
  covariance.labels.pop_back();
  EXPECT_FALSE(write_covariance(folder.path(), covariance));
  ASSERT_TRUE(write_npy(folder / "covariance.npy", Eigen::MatrixXd::Identity(2, 2)));
  EXPECT_FALSE(read_covariance(folder.path()));
}

}  // namespace
}  // namespace crosstie::base
