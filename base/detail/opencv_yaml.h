#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

namespace crosstie::base::detail {

/// What of OpenCV's YAML a camera file needs: scalars and matrices of the top level.
struct YamlMatrix {
  int rows = 0;
  int columns = 0;
  std::vector<double> data;  ///< row by row
};

struct YamlDocument {
  std::map<std::string, std::string> scalars;  ///< keys in lower case
  std::map<std::string, YamlMatrix> matrices;  ///< keys in lower case; rows * columns values each
};

struct YamlError {
  int line = 0;
  std::string reason;
};

/// Reads `key: value` lines of the top level and blocks of indented rows, cols and data (with or without !!opencv-matrix, so
/// that ROS's camera files read, too). Other blocks are skipped. A matrix with more or fewer values than its rows and columns
/// ask for is an error.
tl::expected<YamlDocument, YamlError> parse_opencv_yaml(std::string_view text);

}  // namespace crosstie::base::detail
