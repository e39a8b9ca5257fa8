#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/detail/result_json.h"
#include "base/json_file.h"
#include "base/machine.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base::detail {

/// Why a result cannot be read; its readers turn it and nlohmann's exceptions into an Error.
struct Unreadable : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A kBadInput Error that names the file.
tl::unexpected<Error> bad_result(const std::filesystem::path& path, std::string_view what);

/// What `parse` makes of the result.json in a folder; what it throws becomes an Error that names the file.
template <typename Parse>
auto read_result(const std::filesystem::path& folder, Parse parse) -> Result<decltype(parse(std::declval<const Json&>()))> {
  const auto path = folder / "result.json";
  const auto json = read_json(path);
  if (!json) return tl::unexpected<Error>(json.error());
  try {
    return parse(*json);
  } catch (const Json::exception& error) {
    return bad_result(path, error.what());
  } catch (const Unreadable& error) {
    return bad_result(path, error.what());
  }
}

/// A list of exactly so many numbers.
Eigen::VectorXd numbers(const Json& json, Eigen::Index size);
/// A symmetric matrix from its upper triangle, row by row.
Eigen::MatrixXd symmetric(const Json& json, Eigen::Index size);
/// From 16 numbers, row by row.
Pose pose_of(const Json& json);
/// An entry of "cameras", with its covariance where there is one.
Camera lens_of(const Json& json);
/// The row of a covariance that belongs to a parameter, whatever its unit ("camera left k1", "camera left fx [px]"); nothing where it
/// was held.
std::optional<Eigen::Index> row_of(const std::vector<std::string>& labels, const std::string& parameter);
/// Of "cameras" and "rig", without a covariance.
Head head_of(const Json& json);
/// Throws where the document is not the result of this verb.
void check_verb(const Json& json, std::string_view verb);

/// What every result says of a camera: name, model, width, height, estimated, param_names, params, sigmas, cov.
Json lens_json(std::string_view name, const Camera& camera, bool estimated);
/// Probabilities, null for those that are not tested.
Json significance_json(const Eigen::VectorXd& p);

}  // namespace crosstie::base::detail
