#include "markers/detail/apriltag_library.h"

#include <algorithm>
#include <cmath>
#include <memory>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

namespace crosstie::markers::detail {
namespace {

struct LibraryFamily {
  std::string_view name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array kFamilies = {
    LibraryFamily{"tag16h5", tag16h5_create, tag16h5_destroy},
    LibraryFamily{"tag25h9", tag25h9_create, tag25h9_destroy},
    LibraryFamily{"tag36h10", tag36h10_create, tag36h10_destroy},
    LibraryFamily{"tag36h11", tag36h11_create, tag36h11_destroy},
    LibraryFamily{"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    LibraryFamily{"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    LibraryFamily{"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    LibraryFamily{"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    LibraryFamily{"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

using FamilyHandle = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

std::optional<FamilyHandle> made_family(std::string_view name) {
  const auto found =
      std::find_if(kFamilies.begin(), kFamilies.end(), [name](const auto& family) { return family.name == name; });
  if (found == kFamilies.end()) return std::nullopt;
  return FamilyHandle(found->create(), found->destroy);
}

TagLayout layout_of(const apriltag_family_t& family) {
  TagLayout layout;
  layout.total_cells = family.total_width;
  layout.border_cells = family.width_at_border;
  layout.white_inside = family.reversed_border;
  layout.cells.assign(static_cast<std::size_t>(family.total_width * family.total_width), TagLayout::kFree);
  const int offset = layout.offset();
  // Number of the ring that a cell lies in, counted from the border square: 0 just inside of it, -1 just outside.
  const auto ring = [&](int x, int y) {
    const auto depth = [&](int at) { return std::min(at - offset, offset + layout.border_cells - 1 - at); };
    return std::min(depth(x), depth(y));
  };
  for (int y = 0; y < layout.total_cells; ++y) {
    for (int x = 0; x < layout.total_cells; ++x) {
      int& cell = layout.cells[static_cast<std::size_t>(y * layout.total_cells + x)];
      if (ring(x, y) == 0) cell = layout.white_inside ? TagLayout::kWhite : TagLayout::kBlack;
      if (ring(x, y) == -1) cell = layout.white_inside ? TagLayout::kBlack : TagLayout::kWhite;
    }
  }
  for (std::uint32_t bit = 0; bit < family.nbits; ++bit) {
    const int x = static_cast<int>(family.bit_x[bit]) + offset;
    const int y = static_cast<int>(family.bit_y[bit]) + offset;
    layout.cells[static_cast<std::size_t>(y * layout.total_cells + x)] = static_cast<int>(bit);
  }
  return layout;
}

/// How many misread bits are mended while searching.
int mended_bits(const apriltag_family_t& family) {
  constexpr std::uint32_t kLarge = 10000;
  constexpr std::uint32_t kWide = 9;
  if (family.ncodes > kLarge) return 0;
  return family.h >= kWide ? 2 : 1;
}

struct Variant {
  FamilyHandle family;
  std::vector<std::uint64_t> codes;  ///< of an inverted family
  bool inverted = false;
  bool mirrored = false;
};

/// A detector with the variants of one family. An inverted tag is one of the family with complementary codes and a border of
/// the other tone, a mirrored one that of a family whose bits lie mirrored.
class Detector {
 public:
  Detector(std::string_view name, const TagSearch& search) : name_(name), search_(search), handle_(apriltag_detector_create()) {
    handle_->nthreads = 1;  // images are looked at in parallel
    handle_->quad_decimate = 1.0F;
    handle_->quad_sigma = 0.0F;
    handle_->refine_edges = true;
    for (const bool inverted : {false, true}) {
      if (!(inverted ? search.inverted : search.published)) continue;
      for (const bool mirrored : {false, true}) add(inverted, mirrored);
    }
  }
  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;
  ~Detector() {
    apriltag_detector_destroy(handle_);  // before the families that it knows
  }

  [[nodiscard]] bool serves(std::string_view name, const TagSearch& search) const {
    return name == name_ && search.published == search_.published && search.inverted == search_.inverted;
  }

  [[nodiscard]] std::vector<TagCandidate> find(image_u8_t& image) const {
    zarray_t* detections = apriltag_detector_detect(handle_, &image);
    std::vector<TagCandidate> found;
    for (int i = 0; i < zarray_size(detections); ++i) {
      apriltag_detection_t* detection = nullptr;
      zarray_get(detections, i, &detection);
      const auto variant = std::find_if(variants_.begin(), variants_.end(),
                                        [&](const Variant& v) { return v.family.get() == detection->family; });
      TagCandidate candidate;
      candidate.id = detection->id;
      candidate.inverted = variant->inverted;
      candidate.mirrored = variant->mirrored;
      // The library lists lower left, lower right, upper right, upper left; its (0.5, 0.5) is the centre of the first pixel.
      for (std::size_t k = 0; k < 4; ++k) {
        candidate.corners_px[k] = {detection->p[3 - k][0] - 0.5, detection->p[3 - k][1] - 0.5};
      }
      found.push_back(candidate);
    }
    apriltag_detections_destroy(detections);
    return found;
  }

 private:
  void add(bool inverted, bool mirrored) {
    FamilyHandle family = *made_family(name_);
    if (mirrored) {
      for (std::uint32_t bit = 0; bit < family->nbits; ++bit) {
        family->bit_x[bit] = static_cast<std::uint32_t>(family->width_at_border - 1) - family->bit_x[bit];
      }
    }
    std::vector<std::uint64_t> codes;
    if (inverted) {
      // The places of bits are a handle's own, the codes are constants that all handles share.
      family->reversed_border = !family->reversed_border;
      const std::uint64_t all = (std::uint64_t{1} << family->nbits) - 1U;
      for (std::uint32_t i = 0; i < family->ncodes; ++i) codes.push_back(~family->codes[i] & all);
      family->codes = codes.data();
    }
    apriltag_detector_add_family_bits(handle_, family.get(), mended_bits(*family));
    variants_.push_back({std::move(family), std::move(codes), inverted, mirrored});
  }

  std::string name_;
  TagSearch search_;
  std::vector<Variant> variants_;
  apriltag_detector_t* handle_;
};

/// The image in 8 bits, its brightest value at 255: the library's thresholds are in grey levels, and 12-bit images that are
/// exposed low keep their steps.
std::vector<std::uint8_t> eight_bit(const base::ImageView& image) {
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  std::size_t i = 0;
  if (image.bits == 8) {
    for (int y = 0; y < image.height; ++y, i += static_cast<std::size_t>(image.width)) {
      std::copy_n(image.row<std::uint8_t>(y), image.width, grey.begin() + static_cast<std::ptrdiff_t>(i));
    }
    return grey;
  }
  double brightest = 1.0;
  for (int y = 0; y < image.height; ++y) {
    const std::uint16_t* row = image.row<std::uint16_t>(y);
    brightest = std::max(brightest, static_cast<double>(*std::max_element(row, row + image.width)));
  }
  const double scale = 255.0 / std::min(brightest, image.white_level);
  for (int y = 0; y < image.height; ++y) {
    const std::uint16_t* row = image.row<std::uint16_t>(y);
    for (int x = 0; x < image.width; ++x) {
      grey[i++] = static_cast<std::uint8_t>(std::min(255.0, std::round(scale * row[x])));
    }
  }
  return grey;
}

}  // namespace

std::vector<std::string> apriltag_names() {
  std::vector<std::string> names;
  for (const LibraryFamily& family : kFamilies) names.emplace_back(family.name);
  return names;
}

std::optional<MarkerFamily> apriltag_family(std::string_view name) {
  const auto library = made_family(name);
  if (!library) return std::nullopt;
  const apriltag_family_t& known = **library;
  MarkerFamily family;
  family.bits = static_cast<int>(known.nbits);
  family.tag = layout_of(known);
  family.codes.reserve(known.ncodes);
  for (std::uint32_t id = 0; id < known.ncodes; ++id) family.codes.push_back({static_cast<int>(id), known.codes[id]});
  return family;
}

std::vector<TagCandidate> find_tags(const base::ImageView& image, std::string_view name, const TagSearch& search) {
  thread_local std::unique_ptr<Detector> detector;
  if (!detector || !detector->serves(name, search)) {
    detector.reset();  // the old tables first: two of them need not fit
    detector = std::make_unique<Detector>(name, search);
  }
  std::vector<std::uint8_t> grey = eight_bit(image);
  image_u8_t view = {image.width, image.height, image.width, grey.data()};
  return detector->find(view);
}

}  // namespace crosstie::markers::detail
