// The drawing of base/tool_path.h: DXF is lines in pairs, a group code and its value.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/file.h"
#include "base/tool_path.h"

namespace crosstie::base {
namespace {

constexpr double kTorchEvery_mm = 50.0;
constexpr double kTorchLength_mm = 20.0;
constexpr int kWhite = 7;
constexpr int kRed = 1;
constexpr int kBlue = 5;

class Drawing {
 public:
  void pair(int code, std::string_view value) { text_ += fmt::format("{:>3}\n{}\n", code, value); }
  void pair(int code, int value) { text_ += fmt::format("{:>3}\n{:>6}\n", code, value); }
  /// With group codes 10, 20, 30 for `which` = 0, 11, 21, 31 for 1.
  void place(const Eigen::Vector3d& p, int which = 0) {
    for (int axis = 0; axis < 3; ++axis) text_ += fmt::format("{:>3}\n{:.6f}\n", 10 * (axis + 1) + which, p(axis) + 0.0);
  }
  void polyline(std::string_view layer, const std::vector<Eigen::Vector3d>& points, bool closed) {
    pair(0, "POLYLINE");
    pair(8, layer);
    pair(66, 1);  // vertices follow
    place(Eigen::Vector3d::Zero());
    constexpr int kThreeDimensional = 8;
    pair(70, kThreeDimensional + (closed ? 1 : 0));
    for (const auto& p : points) {
      pair(0, "VERTEX");
      pair(8, layer);
      place(p);
      constexpr int kOfThreeDimensional = 32;
      pair(70, kOfThreeDimensional);
    }
    pair(0, "SEQEND");
    pair(8, layer);
  }
  void line(std::string_view layer, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    pair(0, "LINE");
    pair(8, layer);
    place(from);
    place(to, 1);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void header(Drawing& drawing, const ToolPath& path) {
  Eigen::Vector3d low = path.points[0].point_mm;
  Eigen::Vector3d high = low;
  for (const auto& p : path.points) {
    low = low.cwiseMin(p.point_mm);
    high = high.cwiseMax(p.point_mm);
  }
  drawing.pair(999, fmt::format("crosstie tool path, unit mm, frame {}", path.frame));
  drawing.pair(0, "SECTION");
  drawing.pair(2, "HEADER");
  drawing.pair(9, "$ACADVER");
  drawing.pair(1, "AC1009");
  drawing.pair(9, "$INSUNITS");
  drawing.pair(70, 4);
  drawing.pair(9, "$MEASUREMENT");
  drawing.pair(70, 1);
  drawing.pair(9, "$EXTMIN");
  drawing.place(low);
  drawing.pair(9, "$EXTMAX");
  drawing.place(high);
  drawing.pair(0, "ENDSEC");
}

void layers(Drawing& drawing) {
  drawing.pair(0, "SECTION");
  drawing.pair(2, "TABLES");
  drawing.pair(0, "TABLE");
  drawing.pair(2, "LAYER");
  drawing.pair(70, 4);
  for (const auto& [name, colour] : {std::pair{"0", kWhite}, {"PATH", kWhite}, {"GAPS", kRed}, {"TORCH", kBlue}}) {
    drawing.pair(0, "LAYER");
    drawing.pair(2, name);
    drawing.pair(70, 0);
    drawing.pair(62, colour);
    drawing.pair(6, "CONTINUOUS");
  }
  drawing.pair(0, "ENDTAB");
  drawing.pair(0, "ENDSEC");
}

}  // namespace

Result<> write_tool_path_dxf(const std::filesystem::path& path, const ToolPath& tool_path) {
  if (tool_path.points.size() < 2) return fail(ErrorCode::kInternal, "a tool path of less than two points cannot be drawn");
  Drawing drawing;
  header(drawing, tool_path);
  layers(drawing);
  drawing.pair(0, "SECTION");
  drawing.pair(2, "ENTITIES");
  std::vector<Eigen::Vector3d> all;
  for (const auto& p : tool_path.points) all.push_back(p.point_mm);
  if (tool_path.closed) all.pop_back();
  drawing.polyline("PATH", all, tool_path.closed);
  std::vector<Eigen::Vector3d> stretch;
  const auto end_stretch = [&] {
    if (stretch.size() > 1) drawing.polyline("GAPS", stretch, false);
    stretch.clear();
  };
  for (const auto& p : tool_path.points) {
    if (p.source == PathSource::kMeasured) {
      end_stretch();
    } else {
      stretch.push_back(p.point_mm);
    }
  }
  end_stretch();
  double next = 0.0;
  for (const auto& p : tool_path.points) {
    if (p.s_mm < next) continue;
    drawing.line("TORCH", p.point_mm, p.point_mm + kTorchLength_mm * p.torch);
    next = p.s_mm + kTorchEvery_mm;
  }
  drawing.pair(0, "ENDSEC");
  drawing.pair(0, "EOF");
  return write_file_atomically(path, drawing.text());
}

}  // namespace crosstie::base
