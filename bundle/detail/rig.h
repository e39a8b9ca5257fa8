#pragma once

#include "bundle/detail/state.h"
#include "bundle/detail/survey.h"

namespace crosstie::bundle::detail {

/// Where the cameras of each rig sit, from images that were oriented one by one: for each camera the relative pose that agrees best
/// with those of all stations. With it, images of the rig that could not be oriented themselves follow from the others of their
/// station. A camera none of whose images shares a station with one of the rig's first camera keeps poses of its own; a warning says
/// so.
void mount_cameras(Survey& survey, State& state);

}  // namespace crosstie::bundle::detail
