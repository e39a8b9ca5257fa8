#pragma once

#include <filesystem>

#include "base/calibration.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads what later verbs need of a calibration back from the folder of its result: cameras (lens, covariance, calibrated area,
/// temperature), rig, the board's certificate and pitch, the figures of the whole, and the joint covariance with its labels. Views,
/// residuals and validation stay empty.
///
/// Errors: kFileSystem; kBadInput with the file where the folder holds no result of `calibrate`, a value is missing or of the
/// wrong kind, or the covariance does not belong to these cameras.
Result<Calibration> read_calibration(const std::filesystem::path& folder);

/// The joint covariance of the lens parameters of `cameras` (in this order, all parameters of each) and then, if asked for, of
/// right_from_left [rad, mm]; parameters that were held have zeros.
/// An Error (kBadInput) where the calibration does not know one of them.
Result<Eigen::MatrixXd> joint_covariance(const Calibration& calibration, const std::vector<std::string>& cameras,
                                         bool with_rig);

}  // namespace crosstie::base
