#include "tests/damage/readers.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/aicon_files.h"
#include "base/aicon_network.h"
#include "base/calibration_reader.h"
#include "base/camera_file.h"
#include "base/colmap_model.h"
#include "base/commissioning_reader.h"
#include "base/edge_pixels.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/measured_points.h"
#include "base/network_reader.h"
#include "base/npy.h"
#include "base/opencv_stereo.h"
#include "base/pattern_sequence.h"
#include "base/pcd.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/sphere_list.h"
#include "base/stitching_document.h"
#include "base/stitching_reader.h"
#include "base/table.h"
#include "base/tool_path.h"
#include "calib/corners.h"
#include "edge/nominal_file.h"
#include "fixtures/scene.h"
#include "tests/base/colmap_scene.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/synthetic_commissioning.h"
#include "tests/support/synthetic_stitching.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;
using Files = std::vector<std::pair<std::string, std::string>>;

const std::string kScene = R"(format = "crosstie-scene/1"
name = "portal"
[[camera]]
name = "left"
size_px = [640, 480]
parameters = [601.25, 600, 319.5, 239.5, -0.1, 0.05, 0, 0, 0]
[[camera]]
name = "right"
size_px = [640, 480]
parameters = [600, 600, 319.5, 239.5, -0.1, 0.05, 0, 0, 0]
[[body]]
name = "cross"
[[body.ball]]
id = 1
centre_mm = [50, 0, 20]
diameter_mm = 20
[head]
right_position_mm = [200, 0, 30]
[board]
corners = [9, 6]
pitch_mm = 20
sigma_mm = 0.02
poses = 2
[cross]
body = "cross"
[machine]
rig_position_mm = [0, 0, 600]
[[station]]
name = "x100"
axis_mm = 100
)";

/// A reader of one file as what went wrong with it.
template <typename Read>
auto answer(Read read) {
  return [read](const fs::path& path) -> std::optional<base::Error> {
    const auto result = read(path);
    return result ? std::nullopt : std::optional<base::Error>(result.error());
  };
}

/// The same of a reader of the folder that the file is in.
template <typename Read>
auto answer_of_folder(Read read) {
  return [read](const fs::path& path) { return answer(read)(path.parent_path()); };
}

/// The files that `write` makes in a folder.
template <typename Write>
Files files_of(Write write) {
  const TemporaryFolder folder;
  Files files;
  if (!write(folder.path())) return files;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    files.emplace_back(entry.path().filename().string(), read_all(entry.path()));
  }
  return files;
}

template <typename Write>
std::string contents_of(Write write) {
  return files_of([&](const fs::path& folder) { return write(folder / "file.png"); }).at(0).second;
}

base::ToolPath some_path() {
  base::ToolPath path;
  path.frame = "machine";
  path.points.resize(2);
  path.points[1].point_mm = {1001.25, 0.0, 0.0};
  return path;
}

base::Camera some_camera() {
  Eigen::VectorXd p(9);
  p << 1000.5, 1001.25, 319.5, 239.5, -0.1, 0.05, 1e-4, -2e-4, 0.01;
  return *base::Camera::make(base::LensModel::kOpenCv5, 640, 480, p);
}

base::Camera some_splined_camera() {
  Eigen::VectorXd p = Eigen::VectorXd::Constant(22, 0.01);
  p.head<4>() << 1000.5, 1001.25, 319.5, 239.5;
  auto camera = *base::Camera::make(*base::LensModel::splined({2, 3, 3, 80}), 640, 480, p);
  camera.set_valid_region(base::Camera::Region{{10, 20}, {600, 20}, {300, 450}});
  camera.set_covariance(Eigen::MatrixXd::Identity(22, 22) * 0.25);
  return camera;
}

base::Cloud some_cloud() {
  base::Cloud cloud;
  cloud.frame = "machine";
  cloud.fields = {{"sigma_mm", {}}};
  for (int i = 0; i < 20; ++i) {
    cloud.points.emplace_back(i, 0.5 * i, 1000.0 - i);
    cloud.fields[0].values.push_back(0.01 * i);
  }
  return cloud;
}

base::AdjustedNetwork some_network() {
  base::AdjustedNetwork network;
  network.cameras = {{"left", some_camera(), true}};
  network.images.emplace_back();
  network.images.back().name = "a";
  network.images.back().camera = "left";
  for (int id = 1; id <= 3; ++id) {
    network.points.emplace_back();
    network.points.back().id = id;
    network.points.back().xyz_mm = {1.0 * id, 2.0, 3.0};
    network.points.back().cov_mm2 = Eigen::Matrix3d::Identity() * 1e-4;
    base::AdjustedObservation observation;
    observation.point = id - 1;
    observation.measured_px = {100.5 + id, 200.25};
    network.residuals.push_back(observation);
  }
  return network;
}

base::Result<> write_some_result(const fs::path& folder) {
  base::ResultEnvelope envelope;
  envelope.verb = "adjust";
  envelope.frame = "network";
  if (auto ok = base::write_residuals(folder / "residuals.csv", some_network()); !ok) return ok;
  return base::write_json(folder / "result.json", base::result_json(envelope, {}, base::network_json(some_network())));
}

base::Result<> write_some_commissioning(const fs::path& folder) {
  const base::Commissioning result = synthetic_commissioning();
  const base::ResultEnvelope envelope{"commission", "machine", {}, {}, {}};
  if (auto ok = base::write_covariance(folder, {result.covariance, result.labels}); !ok) return ok;
  return base::write_json(folder / "result.json", base::result_json(envelope, {}, base::commissioning_json(result)));
}

base::Result<> write_some_stitching(const fs::path& folder) {
  const base::Stitching result = synthetic_stitching();
  const base::ResultEnvelope envelope{"stitch", "machine", {}, {}, {}};
  if (auto ok = base::write_covariance(folder, {result.covariance, result.labels}); !ok) return ok;
  return base::write_json(folder / "result.json", base::result_json(envelope, {}, base::stitching_json(result)));
}

base::Result<> write_some_covariance(const fs::path& folder) {
  return base::write_covariance(folder,
                                {Eigen::MatrixXd::Identity(3, 3), {"point 1 x [mm]", "point 1 y [mm]", "point 1 z [mm]"}});
}

base::Result<> write_some_calibration(const fs::path& folder) {
  base::Calibration calibration = synthetic_calibration();
  calibration.views.clear();
  calibration.stations.clear();
  calibration.ladder.clear();
  calibration.cameras[0].area = calibration.cameras[1].area = {1280, 1024};
  const base::ResultEnvelope envelope{"calibrate", "rig", {}, {}, {}};
  auto written = base::write_json(folder / "result.json", base::result_json(envelope, nlohmann::ordered_json::object(),
                                                                            base::calibration_json(calibration)));
  if (!written) return written;
  return base::write_covariance(folder, {calibration.covariance, calibration.labels});
}

void add_tables(std::vector<Reader>& all) {
  const auto points = answer([](const fs::path& p) { return base::read_point_list(p); });
  const auto bars = answer([](const fs::path& p) { return base::read_scale_bars(p); });
  const std::string observations =
      "image,family,id,x_px,y_px,cov_xx,cov_xy,cov_yy,a_px,b_px,angle_rad,margin,status\n"
      "a,ring10,7,100.5,200.25,0.0004,0,0.0004,8,6,0.5,0.9,coded\n"
      "b,ring10,8,101.5,201.25,0.0004,0,0.0004,8,6,0.5,0.9,coded\n";
  all.push_back({"table", {"id,x_mm,name\n1,2.5,\"a, b\"\n2,3.5,c\n3,4.5,d\n", true, false}, answer([](const fs::path& p) {
                   return base::read_table(p);
                 })});
  all.push_back({"points",
                 {"id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n17,1.25,2,3,0.1,0.1,0.1\n2,4,5,6,0.1,0.1,0.1\n", true,
                  false, "1.25", "17", "17,1.25,2,3,0.1,0.1,0.1"},
                 points});
  all.push_back(
      {"points of tabs", {"id\tx_mm\ty_mm\tz_mm\n17\t1.25\t2\t3\n2\t4\t5\t6\n", true, false, "1.25", "17", ""}, points});
  all.push_back({"object list",
                 {"  17 1.25 2.5 3.5 fix fix fix 12 0\n  2 4.5 5.5 6.5 0.1 0.2 0.3 12 0\n", true, false, "1.25", "17",
                  "  2 4.5 5.5 6.5 0.1 0.2 0.3 12 0"},
                 points});
  all.push_back({"scale bars",
                 {"id_a,id_b,length_mm,sigma_mm\n17,2,1000.25,0.01\n3,4,1000.0,0.01\n", true, false, "1000.25", "17",
                  "17,2,1000.25,0.01"},
                 bars});
  const std::string spheres =
      "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,diameter_mm\n17,1.25,2,3,0.1,0.1,0.1,30\n2,4,5,6,0.1,0.1,0.1,38.1\n";
  all.push_back({"spheres", {spheres, true, false, "1.25", "17", "17,1.25,2,3,0.1,0.1,0.1,30"}, answer([](const fs::path& p) {
                   return base::read_reference_spheres(p);
                 })});
  all.push_back({"probed spheres",
                 {spheres, true, false, "1.25", "17", "17,1.25,2,3,0.1,0.1,0.1,30"},
                 answer([](const fs::path& p) { return base::read_probed_spheres(p); })});
  all.push_back({"probe hits",
                 {"sphere,x_mm,y_mm,z_mm\n17,1.25,2,3\n17,2.25,3,3\n", true, false, "1.25", "17", ""},
                 answer([](const fs::path& p) { return base::read_probe_hits(p); })});
  const std::string edges =
      "camera,x_px,y_px,out_x,out_y,sigma_px,noise_px,band_px,step,class\nleft,200.25,7,0.6,-0.8,0.05,0.02,0,-31.5,material\n";
  all.push_back({"edge pixels", {edges, true, false, "200.25", "", ""}, answer([](const fs::path& p) {
                   return base::read_edge_pixels(p);
                 })});
  all.push_back({"observations", {observations, true, false, "200.25", "7", ""}, answer([](const fs::path& p) {
                   return base::read_observations(p);
                 })});
  all.push_back({"image point sigmas",
                 {"image,id,sigma_mm\n31,17,0.0025\n31,18,0.001\n", true, false, "0.0025", "17", "31,17,0.0025"},
                 answer([](const fs::path& p) { return base::read_image_point_sigmas(p); })});
  all.push_back({"image point ids", {"image,id\n31,17\n31,18\n", true, false, "", "17", "31,17"}, answer([](const fs::path& p) {
                   return base::read_image_point_ids(p);
                 })});
}

/// Points without ids, in the forms that fits read.
void add_measured_points(std::vector<Reader>& all) {
  const auto measured = answer([](const fs::path& p) { return base::read_measured_points(p, {"mm", {}}); });
  all.push_back({"plain coordinates", {"1.25 2 3\n4 5 6\n7 8 9\n10 11 12\n", true, false, "1.25"}, measured});
  all.push_back({"counted coordinates", {"3\n1.25\t2\t3\n4\t5\t6\n7\t8\t9\n", true, false, "1.25"}, measured});
  all.push_back({"table of coordinates", {"x_mm;y_mm;z_mm;grey\n1.25;2;3;17\n4;5;6;18\n", true, false, "1.25"}, measured});
}

void add_scans(std::vector<Reader>& all) {
  const std::string manifest = R"({
  "format": "crosstie-patterns/1",
  "x": {"fringes": [1.25], "gray_bits": 2, "word_periods": 1},
  "images": [
    {"kind": "gray", "axis": "x", "bit": 0, "file": "17.png"},
    {"kind": "gray", "axis": "x", "bit": 1, "file": "18.png"},
    {"kind": "fringe", "axis": "x", "shift": 0, "file": "19.png"},
    {"kind": "fringe", "axis": "x", "shift": 0.25, "file": "20.png"},
    {"kind": "fringe", "axis": "x", "shift": 0.5, "file": "21.png"}
  ]
})";
  all.push_back({"pattern manifest", {manifest, true, true, "1.25", "", ""}, answer([](const fs::path& p) {
                   return base::read_pattern_manifest(p);
                 })});
  const std::string lenses =
      "%YAML:1.0\n---\n"
      "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1000., 0., 320.25, 0., 1000., 240., 0., 0., 1. ]\n"
      "D1: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.1, 0., 0., 0., 0. ]\n"
      "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1000., 0., 320., 0., 1000., 240., 0., 0., 1. ]\n"
      "D2: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.1, 0., 0., 0., 0. ]\n";
  const std::string pose =
      "%YAML:1.0\n---\n"
      "R: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]\n"
      "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ -300.25, 0., 0. ]\n";
  all.push_back(
      {"OpenCV stereo lenses",
       {lenses, true, true, "320.25", "", ""},
       answer([](const fs::path& p) { return base::read_opencv_stereo(p, p.parent_path() / "extrinsic.yml", 640, 480); }),
       "intrinsic.yml",
       {{"extrinsic.yml", pose}}});
  all.push_back(
      {"OpenCV stereo pose",
       {pose, true, true, "-300.25", "", ""},
       answer([](const fs::path& p) { return base::read_opencv_stereo(p.parent_path() / "intrinsic.yml", p, 640, 480); }),
       "extrinsic.yml",
       {{"intrinsic.yml", lenses}}});
}

void add_aicon(std::vector<Reader>& all) {
  all.push_back({"AICON image points",
                 {"1 17 1.25 2.5 0.0001 0.0001 0 0 3 1 0\n1 18 2.25 2.5 0.0001 0.0001 0 0 3 1 0\n", true, false, "1.25", "17",
                  "1 17 1.25 2.5 0.0001 0.0001 0 0 3 1 0"},
                 answer([](const fs::path& p) { return base::read_aicon_image_points(p); })});
  all.push_back({"AICON object points",
                 {"17 1.25 2.5 3.5 0.1 0.1 0.1 12 1 0 0\n18 2.25 2.5 3.5 fix fix fix 12 1\n", true, false, "1.25", "17",
                  "18 2.25 2.5 3.5 fix fix fix 12 1"},
                 answer([](const fs::path& p) { return base::read_aicon_object_points(p); })});
  all.push_back({"AICON images",
                 {"17 1 1.25 2 3 0.1 0.2 0.3 0 1 1\n18 1 1 2 3 0.1 0.2 0.3 0 1 1\n", true, false, "1.25", "17",
                  "17 1 1.25 2 3 0.1 0.2 0.3 0 1 1"},
                 answer([](const fs::path& p) { return base::read_aicon_images(p); })});
  all.push_back({"AICON cameras",
                 {"17 -999 -28.5 0.01 0.02 -1e-4 1e-7 0\n1e-10\n1e-5 1e-5\n1e-5 1e-5\n36 24 3600 2400\n", true, true, "0.02",
                  "17", "1e-5 1e-5"},
                 answer([](const fs::path& p) { return base::read_aicon_cameras(p); })});
  all.push_back({"AICON scales",
                 {"0 \"bar\" 17 2 1000.25 0.01 1\n1 \"other bar\" 3 4 1000 0.01 1\n", true, false, "1000.25", "17",
                  "0 \"bar\" 17 2 1000.25 0.01 1"},
                 answer([](const fs::path& p) { return base::read_aicon_scales(p); })});
}

/// One reader for each file of a folder.
template <typename Read>
void add_folder(std::vector<Reader>& all, const std::string& name, const Files& files, Read read) {
  for (const auto& [file, contents] : files) {
    const bool is_text = !file.ends_with(".bin") && !file.ends_with(".npy");
    Reader reader{name + " " + file, {contents, is_text, !file.ends_with(".csv")}, answer_of_folder(read), file};
    for (const auto& other : files) {
      if (other.first != file) reader.beside.push_back(other);
    }
    all.push_back(std::move(reader));
  }
}

}  // namespace

std::vector<Reader> readers() {
  const auto camera = answer([](const fs::path& p) { return base::read_camera(p); });
  const auto ply = answer([](const fs::path& p) { return base::read_ply(p); });
  std::vector<Reader> all;
  all.push_back({"json",
                 {"{\"a\": [1, 2.5, null],\n \"b\": {\"c\": \"text\"}}\n", true, true, "2.5"},
                 answer([](const fs::path& p) { return base::read_json(p); })});
  add_tables(all);
  add_measured_points(all);
  add_scans(all);
  add_aicon(all);
  all.push_back(
      {"cameramodel",
       {contents_of([](const fs::path& p) { return base::write_cameramodel(p, some_camera()); }), true, true, "1001.25"},
       camera});
  all.push_back({"cameramodel with a spline",
                 {contents_of([](const fs::path& p) { return base::write_cameramodel(p, some_splined_camera()); }), true, true,
                  "1001.25"},
                 camera});
  all.push_back(
      {"OpenCV YAML",
       {contents_of([](const fs::path& p) { return base::write_opencv_yaml(p, some_camera()); }), true, true, "1001.25"},
       camera});
  all.push_back({"kalibr chain",
                 {"cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.1, 0.05, 1e-4, -2e-4]\n  distortion_model: radtan\n"
                  "  intrinsics: [1000.5, 1001.25, 319.5, 239.5]\n  resolution: [640, 480]\n",
                  true, true, "1001.25"},
                 camera});
  const auto pcd = answer([](const fs::path& p) { return base::read_pcd(p); });
  all.push_back({"binary PCD", {contents_of([](const fs::path& p) { return base::write_pcd(p, some_cloud()); })}, pcd});
  all.back().takes_mark = false;
  all.push_back(
      {"ASCII PCD",
       {"FIELDS x y z id\nSIZE 4 4 4 4\nTYPE F F F I\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3 7\n4 5 6 "
        "8\n"},
       pcd});
  all.back().takes_mark = false;
  all.push_back(
      {"tool path",
       {contents_of([](const fs::path& p) { return base::write_tool_path_json(p, some_path()); }), true, true, "1001.25"},
       answer([](const fs::path& p) { return base::read_tool_path_json(p); })});
  all.push_back({"binary PLY", {contents_of([](const fs::path& p) { return base::write_ply(p, some_cloud()); })}, ply});
  all.push_back({"ASCII PLY",
                 {"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
                  "1 2 3\n4 5 6.25\n",
                  true, false, "6.25", "", "4 5 6.25"},
                 ply});
  all.back().takes_mark = false;
  all.push_back(
      {"mesh",
       {"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n1 2 3\n4 5 6.25\n4 7 8\n3 0 1 2\n",
        true, false, "6.25"},
       answer([](const fs::path& p) { return base::read_ply_mesh(p); })});
  all.back().takes_mark = false;
  all.push_back(
      {"nominal hole",
       {"x_mm,y_mm,z_mm,nx,ny,nz\n1.25,0,0,0,0,1\n100,0,0,0,0,1\n100,50,0,0,0,1\n0,50,0,0,0,1\n", true, false, "1.25"},
       answer([](const fs::path& p) { return edge::read_nominal(p, {.unit = "mm"}); })});
  all.push_back(
      {"vnl",
       {"# filename x y level\nleft01.jpg 244.25 94.5 0\nleft01.jpg 274.5 92.25 1\nleft02.jpg - -\n", true, false, "244.25"},
       answer([](const fs::path& p) { return calib::read_vnl(p); })});
  all.push_back({"npy",
                 {contents_of([](const fs::path& p) { return base::write_npy(p, Eigen::MatrixXd::Identity(5, 5)); })},
                 answer([](const fs::path& p) { return base::read_npy(p); })});
  // By OpenCV's encoders when the tests were built.
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(CROSSTIE_IMAGE_SAMPLES)) images.push_back(entry.path());
  std::sort(images.begin(), images.end());
  for (const fs::path& image : images)
    all.push_back({"image " + image.filename().string(), {read_all(image)}, answer([](const fs::path& p) {
                     return base::read_image(p);
                   })});
  add_folder(all, "adjusted network", files_of(write_some_result),
             [](const fs::path& folder) { return base::read_adjusted_network(folder); });
  add_folder(all, "calibration", files_of(write_some_calibration),
             [](const fs::path& folder) { return base::read_calibration(folder); });
  add_folder(all, "commissioning", files_of(write_some_commissioning),
             [](const fs::path& folder) { return base::read_commissioning(folder); });
  add_folder(all, "stitching", files_of(write_some_stitching),
             [](const fs::path& folder) { return base::read_stitching(folder); });
  add_folder(all, "covariance", files_of(write_some_covariance),
             [](const fs::path& folder) { return base::read_covariance(folder); });
  for (const auto& [name, format] :
       {std::pair{"COLMAP", base::ColmapFormat::kText}, std::pair{"COLMAP", base::ColmapFormat::kBinary}}) {
    const auto write = [format = format](const fs::path& folder) {
      return base::write_colmap_model(folder, base::tests::colmap_scene(), format);
    };
    add_folder(all, name, files_of(write), [](const fs::path& folder) { return base::read_colmap_model(folder); });
  }
  all.push_back({"scene of the twin", {kScene, true, false, "601.25"}, answer([](const fs::path& p) {
                   return fixtures::read_scene(p);
                 })});
  return all;
}

}  // namespace crosstie::tests
