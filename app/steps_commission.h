#pragma once

#include <filesystem>
#include <vector>

#include "app/commission_input.h"
#include "app/steps.h"

namespace crosstie::app {

/// cross photographs, calibration, probed spheres -> the head in the machine's frame.
base::Result<StepOutcome> commission_step(const Job& job, const CommissionSources& sources, const std::filesystem::path& out,
                                          Session& session);

/// A pair of photographs that is held against a commissioning.
struct HeadCheckTask {
  std::filesystem::path left;
  std::filesystem::path right;
  double axis_mm = 0.0;
  std::optional<std::filesystem::path> probed_again;  ///< a list of centres in machine
  std::optional<double> temperature_c;                ///< of the head now
};

/// one pair of photographs against the result in `commissioning` -> whether rig and frame still hold. The lines say it for people.
struct HeadCheckOutcome {
  StepOutcome step;
  std::vector<std::string> lines;
};
base::Result<HeadCheckOutcome> check_head_step(const Job& job, const HeadCheckTask& task,
                                               const std::filesystem::path& commissioning, const std::filesystem::path& out,
                                               Session& session);

}  // namespace crosstie::app
