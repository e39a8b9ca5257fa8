// write_seeds FOLDER: what the fuzzers start from, a folder for each target. Good files by our own writers, as the damage tests have them,
// OpenCV's image files, and rendered markers.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "tests/damage/readers.h"
#include "tests/markers/rendered_marker.h"
#include "tests/support/damage.h"

namespace {

namespace fs = std::filesystem;
using namespace crosstie;
using tests::Reader;

class Seeds {
 public:
  explicit Seeds(fs::path folder) : folder_(std::move(folder)) {}

  void write(const std::string& target, const std::string& bytes) {
    fs::create_directories(folder_ / target);
    std::ofstream(folder_ / target / ("seed" + std::to_string(count_++)), std::ios::binary) << bytes;
  }

 private:
  fs::path folder_;
  int count_ = 0;
};

/// Which target reads what, and the byte that chooses the reader there; negative: there is none.
struct Place {
  std::string target;
  int choice = -1;
};

const std::map<std::string, Place>& places() {
  static const std::map<std::string, Place> all = {
      {"table", {"point_lists", 0}},
      {"points", {"point_lists", 1}},
      {"points of tabs", {"point_lists", 1}},
      {"object list", {"point_lists", 1}},
      {"scale bars", {"point_lists", 2}},
      {"spheres", {"point_lists", 3}},
      {"probed spheres", {"point_lists", 4}},
      {"probe hits", {"point_lists", 5}},
      {"edge pixels", {"point_lists", 6}},
      {"observations", {"point_lists", 7}},
      {"image point sigmas", {"point_lists", 8}},
      {"image point ids", {"point_lists", 9}},
      {"plain coordinates", {"point_lists", 10}},
      {"counted coordinates", {"point_lists", 10}},
      {"table of coordinates", {"point_lists", 10}},
      {"vnl", {"point_lists", 11}},
      {"nominal hole", {"point_lists", 12}},
      {"cameramodel", {"cameras"}},
      {"cameramodel with a spline", {"cameras"}},
      {"OpenCV YAML", {"yaml", 0}},
      {"kalibr chain", {"yaml", 1}},
      {"binary PLY", {"ply"}},
      {"ASCII PLY", {"ply"}},
      {"mesh", {"ply"}},
      {"binary PCD", {"pcd"}},
      {"ASCII PCD", {"pcd"}},
      {"pattern manifest", {"manifests"}},
  };
  return all;
}

const std::map<std::string, Place>& folder_places() {
  static const std::map<std::string, Place> all = {
      {"adjusted network", {"results", 0}}, {"calibration", {"results", 1}}, {"commissioning", {"results", 2}},
      {"stitching", {"results", 3}},        {"covariance", {"results", 4}},  {"COLMAP", {"colmap"}},
  };
  return all;
}

std::string with_choice(const Place& place, const std::string& bytes) {
  return place.choice < 0 ? bytes : std::string(1, static_cast<char>(place.choice)) + bytes;
}

std::string packed(const Reader& reader) {
  std::string bytes = "=== " + reader.file + "\n" + reader.sample.good;
  for (const auto& [name, contents] : reader.beside) bytes += "=== " + name + "\n" + contents;
  return bytes;
}

void write_reader(Seeds& seeds, const Reader& reader) {
  if (const auto place = places().find(reader.name); place != places().end())
    return seeds.write(place->second.target, with_choice(place->second, reader.sample.good));
  if (reader.name.starts_with("image ")) return seeds.write("images", reader.sample.good);
  if (reader.name == "OpenCV stereo lenses") {
    std::string pose = reader.beside.at(0).second;
    pose.erase(0, pose.find("R:"));
    return seeds.write("yaml", with_choice({"", 2}, reader.sample.good + pose));
  }
  // Each folder comes once for each of its files.
  for (const auto& [name, place] : folder_places()) {
    if (!reader.name.starts_with(name) || reader.file.empty()) continue;
    if (reader.file != "result.json" && !reader.file.starts_with("cameras.") && name != "covariance") continue;
    seeds.write(place.target, with_choice(place, packed(reader)));
    if (reader.file == "result.json") seeds.write("results", with_choice({"", 5}, packed(reader)));
    if (name == "adjusted network") seeds.write("results", with_choice({"", 7}, packed(reader)));
  }
}

void write_aicon(Seeds& seeds, const std::vector<Reader>& readers) {
  const std::map<std::string, std::string> names = {{"AICON object points", "p.obc"},
                                                    {"AICON image points", "p.phc"},
                                                    {"AICON cameras", "p.ior"},
                                                    {"AICON images", "p.eor"},
                                                    {"AICON scales", "p.scale"}};
  std::string project;
  for (const Reader& reader : readers) {
    const auto name = names.find(reader.name);
    if (name == names.end()) continue;
    seeds.write("aicon", "=== " + name->second + "\n" + reader.sample.good);
    project += "=== " + name->second + "\n" + reader.sample.good;
  }
  seeds.write("aicon", project);
  // One that belongs together.
  seeds.write("aicon",
              "=== p.obc\n1 1.5 2.5 3.5 0.1 0.1 0.1 2 1 0 1\n2 2.5 2.5 3.5 fix fix fix 2 1 0 1\n"
              "=== p.phc\n1 1 1.25 2.5 0.0001 0.0001 0 0 3 1 0\n1 2 2.25 2.5 0.0001 0.0001 0 0 3 1 0\n"
              "=== p.ior\n7 -999 -28.5 0.01 0.02 -1e-4 1e-7 0\n1e-10\n1e-5 1e-5\n1e-5 1e-5\n36 24 3600 2400\n"
              "=== p.eor\n1 7 1.25 2 3 0.1 0.2 0.3 0 1 1\n"
              "=== p.scale\n0 \"bar\" 1 2 1000.25 0.01 1\n");
}

/// A marker as test target `markers` takes it.
std::string marker_seed(int family, const tests::MarkerScene& scene, const tests::Noise& noise, int bits) {
  const base::Image image =
      tests::photograph(tests::rendered(scene), scene.width_px, scene.height_px, noise, bits, bits == 8 ? 255.0 : 4095.0);
  std::string bytes = {static_cast<char>(family), static_cast<char>(scene.width_px - 8), static_cast<char>(bits == 8 ? 0 : 1)};
  const base::ImageView view = image.view();
  bytes.append(reinterpret_cast<const char*>(view.data), static_cast<std::size_t>(view.row_stride_bytes * view.height));
  return bytes;
}

void write_markers(Seeds& seeds) {
  const char* names[] = {"ring10", "aicon12", "agisoft16", "apriltag:tag36h11", "apriltag:tag16h5"};
  for (int i = 0; i < 5; ++i) {
    for (int variant = 0; variant < 3; ++variant) {
      tests::MarkerScene scene;
      scene.family = *markers::marker_family(names[i]);
      scene.code = scene.family.codes[static_cast<std::size_t>(7 * variant + 3)].code;
      scene.coded = variant != 2;
      scene.dark_on_bright = variant == 1;
      const bool tag = scene.family.tag.has_value();
      scene.width_px = scene.height_px = tag ? 44 : 52;
      scene.centre_px.setConstant(0.5 * (scene.width_px - 1));
      scene.radius_px = tag ? 3.0 : 4.5;
      scene.tilt_rad = 0.3 * variant;
      scene.samples_per_px = 4;
      seeds.write("markers",
                  marker_seed(i, scene, {1.0, static_cast<std::uint64_t>(variant + 1)}, variant == 1 && tag ? 16 : 8));
    }
  }
}

void write_requests(Seeds& seeds) {
  const std::string host = "Host: 127.0.0.1:8137\r\n";
  for (const char* path : {"/", "/state", "/events", "/camera/left", "/camera/right.jpg", "/scene", "/favicon.ico", "/results/",
                           "/results/scan/report.html", "/results/%2e%2e/secret.txt", "/results/link.txt", "/nothing?x=1"})
    seeds.write("http_requests", std::string("GET ") + path + " HTTP/1.1\r\n" + host + "\r\n");
  seeds.write("http_requests", "HEAD /results/scan/cloud.ply HTTP/1.0\r\n" + host + "If-None-Match: \"tag-1\"\r\n\r\n");
  const std::string command =
      "POST /command HTTP/1.1\r\n" + host + "Origin: http://127.0.0.1:8137\r\nX-Crosstie-Token: 0123456789abcdef\r\n";
  seeds.write("http_requests", command + "Content-Length: 19\r\n\r\n{\"command\": \"next\"}");
  seeds.write("http_requests",
              command + "Expect: 100-continue\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n{\"com\r\n2;x=y\r\nm}\r\n0\r\n\r\n");
}

void write_devices(Seeds& seeds) {
  for (const char* lines :
       {"850.04\r\n+  851.5 mm\n", "<Idle|MPos:850.040,0.000|FS:0,0>\nX850040.5 um Y12\n", "- 12,5\nX -1e3\n"})
    seeds.write("devices", std::string("\x00\x07", 2) + lines);
  seeds.write("devices", std::string("\x01\x00\x42\x01\x00\x80\x00\x04\x00\x01\x00\x00\x09\x38", 14));  // reads a register
  for (char format = 2; format < 7; ++format) seeds.write("devices", std::string{format, 4} + std::string(64, 'p'));
}

void write_jobs(Seeds& seeds) {
  for (const auto& entry : fs::directory_iterator(fs::path(CROSSTIE_SOURCE_DIR) / "tests/fuzz/seeds/jobs")) {
    std::ifstream stream(entry.path(), std::ios::binary);
    seeds.write("jobs", {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()});
  }
}

}  // namespace

int main(int count, char** words) {
  if (count != 2) {
    std::fprintf(stderr, "usage: write_seeds FOLDER\n");
    return 2;
  }
  Seeds seeds(words[1]);
  const auto readers = tests::readers();
  for (const Reader& reader : readers) write_reader(seeds, reader);
  write_aicon(seeds, readers);
  write_markers(seeds);
  write_requests(seeds);
  write_devices(seeds);
  write_jobs(seeds);
  return 0;
}
