#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "verify/acceptance.h"

namespace crosstie::app {

/// A cloud with an artefact in it.
struct AcceptancePlace {
  std::string name;
  std::string artefact;         ///< sphere, bar, plane
  std::filesystem::path cloud;  ///< in place, not relative
  verify::SphereArtefact sphere;
  verify::BarArtefact bar;
  verify::PlaneArtefact plane;
};

/// An acceptance test as its file describes it (docs/formats.md).
struct AcceptanceFile {
  std::string name;
  verify::AcceptanceOptions options;
  verify::AcceptanceLimits limits;
  std::string limits_source;
  double volume_diagonal_mm = 0.0;      ///< 0: not given
  std::string unit;                     ///< of clouds that do not say it
  std::vector<AcceptancePlace> places;  ///< by name
};

/// Reads it. Unknown keys, missing sections and values out of their domain are kBadInput with file and line.
base::Result<AcceptanceFile> read_acceptance_file(const std::filesystem::path& path);

}  // namespace crosstie::app
