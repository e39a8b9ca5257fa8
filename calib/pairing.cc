#include "calib/pairing.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::calib {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// The name without what `length` characters at its front have in common with others, digits left whole.
std::size_t common_front(const std::vector<std::string>& names) {
  std::size_t length = names.front().size();
  for (const std::string& name : names) {
    std::size_t same = 0;
    while (same < std::min(length, name.size()) && name[same] == names.front()[same]) ++same;
    length = same;
  }
  while (length > 0 && is_digit(names.front()[length - 1])) --length;
  return length;
}

std::size_t common_back(std::vector<std::string> names) {
  for (std::string& name : names) std::reverse(name.begin(), name.end());
  return common_front(names);
}

/// Numbers by value before words.
using Key = std::pair<std::int64_t, std::string>;

Key key_of(std::string_view rest) {
  constexpr std::size_t kMostDigits = 18;
  const bool number = !rest.empty() && rest.size() <= kMostDigits && std::all_of(rest.begin(), rest.end(), is_digit);
  if (number) return {*base::parse_int(rest), ""};
  return {-1, std::string(rest)};
}

}  // namespace

Result<std::vector<base::BoardStation>> pair_by_name(const std::vector<base::BoardImage>& images,
                                                     const std::vector<std::string>& cameras) {
  struct Moment {
    std::string name;
    std::vector<int> images;
  };
  std::map<Key, Moment> moments;
  for (const base::BoardImage& image : images) {
    if (std::find(cameras.begin(), cameras.end(), image.camera) == cameras.end()) {
      return fail(ErrorCode::kBadInput, fmt::format("image {}: there is no camera {}", image.image, image.camera));
    }
  }
  for (const std::string& camera : cameras) {
    std::vector<std::string> stems;
    std::vector<int> indices;
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (images[i].camera != camera) continue;
      stems.push_back(std::filesystem::path(images[i].image).stem().string());
      indices.push_back(static_cast<int>(i));
    }
    if (stems.empty()) continue;
    const std::size_t front = stems.size() > 1 ? common_front(stems) : 0;
    const std::size_t back = stems.size() > 1 ? common_back(stems) : 0;
    std::map<Key, std::string> seen;
    for (std::size_t i = 0; i < stems.size(); ++i) {
      const std::string& stem = stems[i];
      const std::size_t end = std::max(front, stem.size() - std::min(back, stem.size()));
      const std::string rest = stem.substr(front, end - front);
      const Key key = key_of(rest);
      const auto [place, is_new] = seen.emplace(key, stem);
      if (!is_new) {
        return fail(ErrorCode::kBadInput, fmt::format("images {} and {} of camera {} have the same number; which moment does "
                                                      "each belong to?",
                                                      place->second, stem, camera));
      }
      Moment& moment = moments[key];
      if (moment.images.empty()) moment.name = rest;
      moment.images.push_back(indices[i]);
    }
  }
  std::vector<base::BoardStation> result;
  for (auto& [key, moment] : moments) result.push_back({std::move(moment.name), std::move(moment.images)});
  return result;
}

}  // namespace crosstie::calib
