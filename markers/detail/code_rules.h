#pragma once

#include <cstdint>
#include <vector>

#include "markers/family.h"

namespace crosstie::markers::detail {

/// Codes of a start sequence followed by the reflected Gray code of the id (see marker_family(), ring10).
std::vector<MarkerCode> start_sequence_codes(std::uint32_t start_sequence, int start_bits, int data_bits);

/// Schneider's rule (see marker_family(), aicon).
std::vector<MarkerCode> opposite_pair_codes(int bits);

/// Agisoft's rule (see marker_family(), agisoft).
std::vector<MarkerCode> wide_code_codes(int bits);

}  // namespace crosstie::markers::detail
