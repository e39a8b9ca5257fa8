#include "base/observation.h"

namespace crosstie::base {

std::string_view status_name(ObservationStatus status) {
  switch (status) {
    case ObservationStatus::kCoded:
      return "coded";
    case ObservationStatus::kUncoded:
      return "uncoded";
    case ObservationStatus::kAmbiguous:
      return "ambiguous";
    case ObservationStatus::kUnreadable:
      return "unreadable";
    case ObservationStatus::kRefused:
      return "refused";
  }
  return "";
}

}  // namespace crosstie::base
