#include "base/version.h"

namespace crosstie::base {

std::string_view version() { return CROSSTIE_VERSION; }

}  // namespace crosstie::base
