#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "base/file.h"
#include "base/text.h"
#include "calib/corners.h"

namespace crosstie::calib {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr std::string_view kBlank = " \t\r";
  for (std::size_t at = line.find_first_not_of(kBlank); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlank, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBlank, end);
  }
  return words;
}

}  // namespace

Result<std::vector<VnlImage>> read_vnl(const std::filesystem::path& path) {
  const auto contents = base::read_file(path);
  if (!contents) return tl::unexpected(contents.error());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kDeepest = 20.0;  // levels of an image pyramid
  std::vector<VnlImage> images;
  std::set<std::string, std::less<>> names;
  int number = 0;
  std::string_view rest = *contents;
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
  while (!rest.empty()) {
    ++number;
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const auto words = words_of(line.substr(0, line.find('#')));
    if (words.empty()) continue;
    const auto refuse = [&](std::string_view what) {
      return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", base::shown(path), number, what));
    };
    if (words.size() != 3 && words.size() != 4) return refuse("a line is `filename x y` or `filename x y level`");
    if (images.empty() || images.back().image != words[0]) {
      if (!names.insert(std::string(words[0])).second) {
        return refuse(
            fmt::format("image {} comes back after another one; its corners must follow each other", words[0].substr(0, 80)));
      }
      images.push_back({std::string(words[0]), {}, {}});
    }
    VnlImage& image = images.back();
    if (words[1] == "-" && words[2] == "-") {
      image.corners_px.emplace_back(kNan, kNan);
      image.level.push_back(-1.0);
      continue;
    }
    const auto x = base::parse_double(words[1]);
    const auto y = base::parse_double(words[2]);
    if (!x || !y) return refuse("x and y are not numbers");
    double level = 0.0;
    if (words.size() == 4 && words[3] != "-") {
      const auto told = base::parse_double(words[3]);
      if (!told || *told > kDeepest) return refuse("the level of the image pyramid is no number, or beyond 20");
      level = *told;
    }
    image.corners_px.emplace_back(*x, *y);
    image.level.push_back(level);
  }
  if (images.empty()) return fail(ErrorCode::kBadInput, base::shown(path) + ": no corners in it");
  return images;
}

Result<std::vector<base::BoardImage>> board_images(std::span<const VnlImage> vnl, const base::Board& board,
                                                   const std::string& camera, int width_px, int height_px) {
  std::vector<base::BoardImage> result;
  for (const VnlImage& from : vnl) {
    base::BoardImage image{from.image, camera, width_px, height_px, {}};
    const bool nothing = from.corners_px.size() == 1 && !from.corners_px.front().allFinite();
    if (!nothing && static_cast<int>(from.corners_px.size()) != board.count()) {
      return fail(ErrorCode::kBadInput, fmt::format("image {} has {} corners, a board of {} x {} has {}", from.image,
                                                    from.corners_px.size(), board.columns, board.rows, board.count()));
    }
    for (std::size_t i = 0; !nothing && i < from.corners_px.size(); ++i) {
      if (from.level[i] < 0.0) continue;
      image.corners.push_back({static_cast<int>(i), from.corners_px[i], std::exp2(from.level[i])});
    }
    result.push_back(std::move(image));
  }
  return result;
}

}  // namespace crosstie::calib
