#pragma once

#include "base/network.h"
#include "base/result.h"
#include "bundle/detail/survey.h"

namespace crosstie::bundle::detail {

// What a network knows besides its image points, checked and with indices in place of names and ids. The cameras, images and
// points of the survey must be there already. Errors are those of make_survey(); what no image shows is left out with a warning.

base::Result<> add_rigs(const base::Network& network, Survey& survey);
base::Result<> add_control(const base::Network& network, Survey& survey);
base::Result<> add_datum(const base::Network& network, Survey& survey);
/// After the control points: together they must determine the scale, or it must be said to be free.
base::Result<> add_bars(const base::Network& network, Survey& survey);
base::Result<> add_start_values(const base::Network& network, Survey& survey);

}  // namespace crosstie::bundle::detail
