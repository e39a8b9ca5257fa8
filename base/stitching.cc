#include "base/stitching.h"

namespace crosstie::base {

std::string_view segment_name(Segment::Kind kind) {
  switch (kind) {
    case Segment::Kind::kPlane:
      return "plane";
    case Segment::Kind::kCylinder:
      return "cylinder";
    case Segment::Kind::kCone:
      return "cone";
    case Segment::Kind::kNone:
      break;
  }
  return "none";
}

}  // namespace crosstie::base
