#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "base/point_list.h"
#include "base/result.h"

namespace crosstie::base::detail {

/// AICON's object coordinates (.obc, "Positions-3D" lists): blank-separated, no header, mm:
///     id x y z sx sy sz rays active [new [datum]]
/// `fix` in place of a sigma means that none is given. A point whose `active` is 0 took no part in the adjustment and is left
/// out, except in lists that set the flag nowhere: there it carries no meaning.
struct ObjectListRow {
  ReferencePoint point;
  int line = 0;
};

/// Whether the first line that holds anything looks like one: 9 to 11 cells, all of them numbers or `fix`.
bool is_object_list(std::string_view contents);

Result<std::vector<ObjectListRow>> read_object_list(const std::filesystem::path& path, std::string_view contents);

}  // namespace crosstie::base::detail
