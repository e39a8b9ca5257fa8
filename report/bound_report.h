#pragma once

#include <string>
#include <vector>

namespace crosstie::report {

/// A report that is to be bound with others.
struct BoundPage {
  std::string html;      ///< as one of the functions of this library wrote it
  std::string folder;    ///< absolute path of the folder that its images are in
  std::string from_top;  ///< its address as the first page names it, "calibrate/report.html": such links then lead inside
};

/// The reports one after the other as one page for the printer: 3D views stand still, as pictures. Style and scripts are those of the
/// page with a 3D view where there is one, else of the first. Empty where a page is none of ours.
std::string bound_report(const std::vector<BoundPage>& pages);

}  // namespace crosstie::report
