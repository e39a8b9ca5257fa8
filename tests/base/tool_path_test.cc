#include "base/tool_path.h"

#include <cmath>
#include <cstdlib>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/table.h"
#include "base/tool_path_gcode.h"
#include "tests/support/rs274.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using std::numbers::pi;
using ::testing::HasSubstr;
using tests::CanonicalCommand;
using tests::run_rs274;
using tests::TemporaryFolder;

/// Round a hole in a wall whose normal is about -y, dented unless it is round; the torch leans over the opening.
ToolPath some_path(bool round = false) {
  ToolPath path;
  path.frame = "machine";
  path.closed = true;
  constexpr int kPoints = 180;
  const Eigen::Vector3d out = -Eigen::Vector3d::UnitY();
  for (int i = 0; i <= kPoints; ++i) {
    const double phi = 2.0 * pi * (i % kPoints) / kPoints;
    const Eigen::Vector3d radial(std::cos(phi), 0.0, std::sin(phi));
    ToolPathPoint p;
    const double r = 300.0 + (round ? 0.0 : 2.0 * std::sin(3.0 * phi));
    p.point_mm = Eigen::Vector3d(1800.0, -20.0, 950.0) + r * radial + (round ? 0.0 : 5.0 * std::cos(2.0 * phi)) * out;
    p.normal = out;
    p.tangent = out.cross(radial).normalized();
    p.torch = round ? out : (std::cos(0.4) * out - std::sin(0.4) * radial).eval();
    p.speed_mm_per_s = 8.0;
    p.sigma_u_mm = 0.05;
    p.sigma_v_mm = 0.04;
    p.source = i > 20 && i < 30 ? PathSource::kNominal : PathSource::kMeasured;
    if (i > 0) {
      const double step = (p.point_mm - path.points.back().point_mm).norm();
      p.s_mm = path.points.back().s_mm + step;
      p.time_s = path.points.back().time_s + step / p.speed_mm_per_s;
    }
    path.points.push_back(p);
  }
  path.length_mm = path.points.back().s_mm;
  path.duration_s = path.points.back().time_s;
  path.gaps = {{path.points[20].s_mm, 100.0, "a magnet"}};
  return path;
}

std::vector<CanonicalCommand> named(const std::vector<CanonicalCommand>& commands, const std::string& name) {
  std::vector<CanonicalCommand> chosen;
  for (const auto& command : commands) {
    if (command.name == name) chosen.push_back(command);
  }
  return chosen;
}

TEST(ToolPathFiles, JsonAndTableHoldEveryNumber) {
  const TemporaryFolder folder;
  const ToolPath path = some_path();
  ASSERT_TRUE(write_tool_path_json(folder / "path.json", path).has_value());
  ASSERT_TRUE(write_tool_path_csv(folder / "path.csv", path).has_value());
  const auto json = read_json(folder / "path.json");
  ASSERT_TRUE(json.has_value());
  EXPECT_EQ((*json)["format"], "crosstie-path/1");
  EXPECT_EQ((*json)["unit"], "mm");
  EXPECT_EQ((*json)["gaps"][0]["reason"], "a magnet");
  const auto table = read_table(folder / "path.csv");
  ASSERT_TRUE(table.has_value());
  ASSERT_EQ(table->rows.size(), path.points.size());
  ASSERT_EQ((*json)["points"].size(), path.points.size());
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    const ToolPathPoint& p = path.points[i];
    const auto& point = (*json)["points"][i];
    constexpr const char* kNames[] = {"x_mm", "y_mm", "z_mm"};
    constexpr const char* kTorch[] = {"torch_x", "torch_y", "torch_z"};
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(point["xyz_mm"][static_cast<std::size_t>(axis)], p.point_mm(axis));
      EXPECT_EQ(*table->number(i, *table->column(kNames[axis])), p.point_mm(axis));
      EXPECT_EQ(point["torch"][static_cast<std::size_t>(axis)], p.torch(axis));
      EXPECT_EQ(*table->number(i, *table->column(kTorch[axis])), p.torch(axis));
    }
    EXPECT_EQ(*table->number(i, *table->column("sigma_u_mm")), p.sigma_u_mm);
    EXPECT_EQ(point["sigma_uv_mm"][1], p.sigma_v_mm);
    EXPECT_EQ(table->rows[i][*table->column("source")], path_source_name(p.source));
  }
}

TEST(ToolPathFiles, AnotherProgramReadsTheDrawing) {
  std::string python;
  for (const char* candidate : {"python3", "/usr/bin/python3"}) {
    if (std::system((std::string(candidate) + " -c 'import ezdxf' >/dev/null 2>&1").c_str()) == 0) python = candidate;
  }
  if (python.empty()) GTEST_SKIP() << "no ezdxf (Debian: python3-ezdxf)";
  const TemporaryFolder folder;
  const ToolPath path = some_path();
  ASSERT_TRUE(write_tool_path_dxf(folder / "path.dxf", path).has_value());
  folder.write("read.py", R"(
import ezdxf, sys
d = ezdxf.readfile(sys.argv[1])
a = d.audit()
print("errors", len(a.errors), "fixes", len(a.fixes))
print("units", d.header["$INSUNITS"])
for e in d.modelspace():
    if e.dxftype() == "POLYLINE":
        print("polyline", e.dxf.layer, e.is_3d_polyline, e.is_closed, len(e.vertices))
        for v in e.vertices:
            print("vertex", e.dxf.layer, v.dxf.location.x, v.dxf.location.y, v.dxf.location.z)
    else:
        print("line", e.dxf.layer, (e.dxf.end - e.dxf.start).magnitude)
)");
  const std::string command = python + " '" + (folder / "read.py").string() + "' '" + (folder / "path.dxf").string() + "' >'" +
                              (folder / "out").string() + "' 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << tests::read_all(folder / "out");
  const std::string out = tests::read_all(folder / "out");
  EXPECT_THAT(out, HasSubstr("errors 0 fixes 0\n"));
  EXPECT_THAT(out, HasSubstr("units 4\n")) << "4 is mm";
  EXPECT_THAT(out, HasSubstr("polyline PATH True True 180\n"));
  EXPECT_THAT(out, HasSubstr("polyline GAPS True False 9\n"));
  std::istringstream lines(out);
  std::size_t at = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("line ")) {
      EXPECT_TRUE(line.starts_with("line TORCH "));
      EXPECT_NEAR(std::stod(line.substr(11)), 20.0, 1e-5);
    }
    if (!line.starts_with("vertex PATH ")) continue;
    Eigen::Vector3d p;
    std::istringstream(line.substr(12)) >> p.x() >> p.y() >> p.z();
    EXPECT_LT((p - path.points[at++].point_mm).norm(), 2e-6);
  }
  EXPECT_EQ(at, 180U);
}

TEST(Gcode, LinuxCncGoesWhereThePathGoes) {
  if (!tests::has_rs274()) GTEST_SKIP() << "no rs274 (Debian: linuxcnc-uspace)";
  const ToolPath path = some_path();
  const auto program = gcode_of(path, {.program = "door (segment 3)\nM30", .retract_mm = 40.0});
  ASSERT_TRUE(program.has_value()) << program.error().message;
  const auto run = run_rs274(*program);
  EXPECT_EQ(run.error, "");
  const auto units = named(run.commands, "USE_LENGTH_UNITS");
  ASSERT_FALSE(units.empty());
  EXPECT_EQ(units.back().text, "CANON_UNITS_MM");
  const auto feeds = named(run.commands, "STRAIGHT_FEED");
  ASSERT_EQ(feeds.size(), path.points.size() + 1) << "to the first point, the path, away from it";
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    const auto& numbers = feeds[i].numbers;
    ASSERT_GE(numbers.size(), 5U);
    EXPECT_LT((Eigen::Vector3d(numbers[0], numbers[1], numbers[2]) - path.points[i].point_mm).norm(), 2e-4);
    const Eigen::Vector3d torch =
        Eigen::AngleAxisd(numbers[3] * pi / 180.0, Eigen::Vector3d::UnitX()) *
        (Eigen::AngleAxisd(numbers[4] * pi / 180.0, Eigen::Vector3d::UnitY()) * Eigen::Vector3d::UnitZ());
    EXPECT_LT((torch - path.points[i].torch).norm(), 3e-6);
    if (i > 0) {
      EXPECT_LT(std::abs(numbers[3] - feeds[i - 1].numbers[3]), 20.0) << "no turn round";
    }
  }
  const auto rates = named(run.commands, "SET_FEED_RATE");
  bool stated = false;
  for (const auto& rate : rates) stated = stated || rate.numbers == std::vector<double>{480.0};
  EXPECT_TRUE(stated) << "8 mm/s are 480 mm/min";
  const auto rapid = named(run.commands, "STRAIGHT_TRAVERSE");
  ASSERT_EQ(rapid.size(), 1U);
  const Eigen::Vector3d approach(rapid[0].numbers[0], rapid[0].numbers[1], rapid[0].numbers[2]);
  EXPECT_LT((approach - path.points[0].point_mm - 40.0 * path.points[0].torch).norm(), 2e-4);
}

TEST(Gcode, ArcsStayWithinTheirTolerance) {
  if (!tests::has_rs274()) GTEST_SKIP() << "no rs274 (Debian: linuxcnc-uspace)";
  for (const bool round : {true, false}) {
    const ToolPath path = some_path(round);
    constexpr double kTolerance_mm = 0.02;
    const auto program = gcode_of(path, {.arc_tolerance_mm = kTolerance_mm});
    ASSERT_TRUE(program.has_value()) << program.error().message;
    EXPECT_THAT(*program, HasSubstr("G18"));
    const auto run = run_rs274(*program);
    EXPECT_EQ(run.error, "");
    const auto arcs = named(run.commands, "ARC_FEED");
    ASSERT_FALSE(arcs.empty());
    EXPECT_LT(arcs.size(), round ? 5U : 90U);
    // In the plane of z and x: first_end, second_end, first_axis, second_axis, rotation, axis_end_point.
    Eigen::Vector2d from(path.points[0].point_mm.z(), path.points[0].point_mm.x());
    std::size_t next = 1;
    for (const auto& command : run.commands) {
      if (command.name == "STRAIGHT_FEED" && next < path.points.size()) {
        from = {command.numbers[2], command.numbers[0]};
        const Eigen::Vector3d& p = path.points[next].point_mm;
        if ((Eigen::Vector2d(p.z(), p.x()) - from).norm() < 1e-3) ++next;
      }
      if (command.name != "ARC_FEED") continue;
      const Eigen::Vector2d end(command.numbers[0], command.numbers[1]);
      const Eigen::Vector2d centre(command.numbers[2], command.numbers[3]);
      const double radius = (end - centre).norm();
      EXPECT_NEAR((from - centre).norm(), radius, 1e-3);
      while (next < path.points.size()) {
        const Eigen::Vector3d& p = path.points[next].point_mm;
        const Eigen::Vector2d flat(p.z(), p.x());
        EXPECT_LT(std::abs((flat - centre).norm() - radius), kTolerance_mm + 1e-3);
        ++next;
        if ((flat - end).norm() < 1e-3) break;
      }
      // It goes the short way: less than half a turn.
      const Eigen::Vector2d a = from - centre;
      const Eigen::Vector2d b = end - centre;
      EXPECT_GT((a.x() * b.y() - a.y() * b.x()) * command.numbers[4], 0.0);
      from = end;
    }
    EXPECT_EQ(next, path.points.size());
  }
}

TEST(Gcode, ATemplateIsTheUsersOwn) {
  const std::string mine =
      "; {frame}\n g 21 G90\nTOOL {{literal}} {tilt_deg}\n{begin points}\nL X{x} C{azimuth_deg} ;{source} {n}\n{end "
      "points}\nEND {x}\n";
  const auto program = gcode_of(some_path(), {.template_text = mine});
  ASSERT_TRUE(program.has_value()) << program.error().message;
  EXPECT_THAT(*program, HasSubstr("; machine\n g 21 G90\nTOOL {literal}} "));
  EXPECT_THAT(*program, HasSubstr(";nominal 21\n"));
  EXPECT_THAT(*program, HasSubstr("END 2100.00000\n"));
}

TEST(Gcode, TemplatesThatDoNotSayWhatTheyMeanAreRefused) {
  const auto message = [](const std::string& text) {
    const auto program = gcode_of(some_path(), {.template_text = text});
    return program ? std::string() : program.error().message;
  };
  const std::string block = "{begin points}\n{motion}\n{end points}\n";
  EXPECT_THAT(message("G90\n" + block), HasSubstr("G21"));
  EXPECT_THAT(message("(G21)\n" + block), HasSubstr("G21"));
  EXPECT_THAT(message("G21\nG20\n" + block), HasSubstr("line 2: G20"));
  EXPECT_THAT(message("G210\n" + block), HasSubstr("G21"));
  EXPECT_THAT(message("G21 X{xx}\n" + block), HasSubstr("line 1: {xx} is no placeholder; did you mean"));
  EXPECT_THAT(message("G21 {motion}\n" + block), HasSubstr("outside of the points"));
  EXPECT_THAT(message("G21 {x\n" + block), HasSubstr("not closed"));
  EXPECT_THAT(message("G21\n"), HasSubstr("no {begin points}"));
  EXPECT_THAT(message("G21\n{begin points}\n"), HasSubstr("without {end points}"));
  EXPECT_THAT(message("G21\n{end points}\n"), HasSubstr("without {begin points}"));
  EXPECT_THAT(message("G21\n" + block + block), HasSubstr("second"));
}

TEST(Gcode, ANumberIsNeverWrittenWithAnExponentOrAComma) {
  ToolPath path = some_path();
  path.points[3].point_mm = {1e-9, -1e-9, 123456.0};
  const auto program = gcode_of(path);
  ASSERT_TRUE(program.has_value());
  EXPECT_THAT(*program, HasSubstr("X0.00000 Y0.00000 Z123456.00000"));
}

}  // namespace
}  // namespace crosstie::base
