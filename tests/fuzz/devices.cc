// What devices send: lines that tell the axis's position, however they are cut on their way; pixels of cameras; requests to a camera of
// GigE Vision. The first byte of an input chooses, the second one sizes.
#include <cmath>
#include <vector>

#include "devices/axis_line.h"
#include "devices/detail/gige_packets.h"
#include "devices/detail/line_splitter.h"
#include "devices/detail/raw_pixels.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;

void read_lines(std::string_view input, std::size_t piece) {
  const devices::AxisLineFormat formats[] = {{},
                                             {.label = "X", .unit = "um", .mm_per_unit = 0.001, .min_mm = -1e4, .max_mm = 1e4}};
  devices::detail::LineSplitter lines(devices::kMaxAxisLineBytes);
  const auto take = [&](std::string_view line) {
    fuzz::expect(!line.empty() && line.size() <= devices::kMaxAxisLineBytes, "lines are bounded and not empty");
    for (const devices::AxisLineFormat& format : formats) {
      const auto position_mm = devices::parse_axis_line(line, format);
      if (fuzz::sensible(position_mm))
        fuzz::expect(std::isfinite(*position_mm) && *position_mm >= format.min_mm && *position_mm <= format.max_mm,
                     "positions lie in the travel");
    }
  };
  for (std::size_t at = 0; at < input.size(); at += piece) {
    lines.push(input.substr(at, piece), take, [](std::string_view) {});
    fuzz::expect(lines.held_bytes() <= devices::kMaxAxisLineBytes, "what is held is bounded");
  }
}

void read_pixels(std::span<const std::byte> bytes, std::size_t width, devices::detail::RawFormat format) {
  const int height = static_cast<int>(bytes.size() / (width + 1)) + 1;
  fuzz::sensible(devices::detail::unpack_pixels(bytes, static_cast<int>(width), height, width % 3, format));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using devices::detail::RawFormat;
  std::string_view input = fuzz::text_of(data, size);
  const std::size_t what = fuzz::choose(input, 7);
  const std::size_t length = 1 + fuzz::choose(input, 64);
  // A copy of its own size, so that reading beyond it is seen.
  const std::vector<std::byte> bytes(reinterpret_cast<const std::byte*>(input.data()),
                                     reinterpret_cast<const std::byte*>(input.data()) + input.size());
  constexpr RawFormat kFormats[] = {RawFormat::kMono8, RawFormat::kMono12, RawFormat::kMono12p, RawFormat::kMono12Packed,
                                    RawFormat::kMono16};
  if (what == 0) {
    read_lines(input, length);
  } else if (what == 1) {
    const auto request = devices::detail::parse_gvcp_request(bytes);
    if (request) fuzz::expect(request->payload.size() <= bytes.size(), "a payload lies in its packet");
  } else {
    read_pixels(bytes, length, kFormats[what - 2]);
  }
  return 0;
}
