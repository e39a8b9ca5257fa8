#include "tests/study/summary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/study/statistics.h"

namespace crosstie::study {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using Value = std::function<double(const ordered_json&)>;

constexpr double kLevel = 0.99;      // of the chi-square bounds
constexpr double kBootstrap = 0.95;  // of the intervals by bootstrap

struct Stage {
  const char* key;
  const char* name;
};
constexpr std::array<Stage, 8> kStages = {{{"lenses", "lenses (calibrate)"},
                                           {"rig", "rig (calibrate)"},
                                           {"frame", "machine's frame, at three readings (commission)"},
                                           {"head", "lenses and rig (commission)"},
                                           {"cloud", "points of the scans (scan)"},
                                           {"stations", "places of the stations (stitch)"},
                                           {"part", "place of the part (edge)"},
                                           {"edge", "points of the rim, u and v (edge)"}}};

struct Study {
  std::vector<ordered_json> seeds;
  int failed = 0;
};

Study read(const fs::path& file) {
  Study study;
  std::ifstream stream(file);
  for (std::string text; std::getline(stream, text);) {
    auto line = ordered_json::parse(text, nullptr, false);
    if (line.is_discarded()) continue;
    if (line.contains("error")) {
      ++study.failed;
    } else {
      study.seeds.push_back(std::move(line));
    }
  }
  std::sort(study.seeds.begin(), study.seeds.end(), [](const auto& a, const auto& b) { return a["seed"] < b["seed"]; });
  return study;
}

std::vector<double> values_of(const Study& study, const Value& value) {
  std::vector<double> values;
  for (const ordered_json& seed : study.seeds) values.push_back(value(seed));
  return values;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

std::vector<Square> squares_of(const Study& study, const std::string& stage) {
  std::vector<Square> squares;
  for (const ordered_json& seed : study.seeds)
    squares.push_back({seed["stages"][stage]["square"].get<double>(), seed["stages"][stage]["dof"].get<double>()});
  return squares;
}

std::string stage_table(const Study& study) {
  std::string text = fmt::format(
      "| stage | dof a seed | mean square over dof | 99 % bounds (chi-square) | 95 % by bootstrap | median | largest | |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const Stage& stage : kStages) {
    const std::vector<Square> squares = squares_of(study, stage.key);
    const MeanSquare mean = mean_square(squares, kLevel);
    std::vector<double> ratios;
    for (const Square& one : squares) ratios.push_back(one.square / one.dof);
    const Interval drawn = bootstrap_mean(ratios, kBootstrap);
    text += fmt::format("| {} | {:.0f} | **{:.2f}** | {:.2f} to {:.2f} | {:.2f} to {:.2f} | {:.2f} | {:.2f} | {} |\n",
                        stage.name, mean.dof / static_cast<double>(squares.size()), mean.mean, mean.expected.low,
                        mean.expected.high, drawn.low, drawn.high, quantile(ratios, 0.5), quantile(ratios, 1.0),
                        mean.expected.holds(mean.mean) ? "inside" : "**off**");
  }
  return text;
}

std::string coverage_table(const Study& study) {
  struct Row {
    const char *where, *key, *name;
    bool mm;
  };
  constexpr std::array<Row, 6> kRows = {{{"edge", "u", "rim, across (u)", true},
                                         {"edge", "v", "rim, along the normal (v)", true},
                                         {"path", "u", "path, across (u)", true},
                                         {"path", "v", "path, along the normal (v)", true},
                                         {"path", "tilt_u", "torch, tilt towards u", false},
                                         {"path", "tilt_t", "torch, tilt along the rim", false}}};
  std::string text =
      "| | within 1 sigma (68.3 %) | within 2 sigma (95.4 %) | mean of (e / sigma)^2 | rms e | rms sigma | mean e | |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Row& row : kRows) {
    const auto of = [&](const char* key) {
      return values_of(study, [&](const ordered_json& seed) { return seed[row.where][row.key][key].get<double>(); });
    };
    const auto percent = [&](const char* key) {
      const std::vector<double> values = of(key);
      const Interval drawn = bootstrap_mean(values, kBootstrap);
      return fmt::format("{:.1f} ({:.1f} to {:.1f}) %", 100.0 * mean_of(values), 100.0 * drawn.low, 100.0 * drawn.high);
    };
    const auto rms = [&](const char* key) {
      double sum = 0.0;
      for (const double value : of(key)) sum += value * value / static_cast<double>(study.seeds.size());
      return std::sqrt(sum);
    };
    const double unit = row.mm ? 1.0 : 1e3;
    const char* name = row.mm ? "mm" : "mrad";
    const std::vector<double> square = of("square"), mean = of("mean");
    const Interval of_square = bootstrap_mean(square, kBootstrap), of_mean = bootstrap_mean(mean, kBootstrap);
    const bool holds =
        bootstrap_mean(of("in_1"), kBootstrap).holds(0.6827) && bootstrap_mean(of("in_2"), kBootstrap).holds(0.9545);
    text += fmt::format(
        "| {} | {} | {} | {:.2f} ({:.2f} to {:.2f}) | {:.4f} {} | {:.4f} {} | {:+.4f} ({:+.4f} to {:+.4f}) {} | {} |\n",
        row.name, percent("in_1"), percent("in_2"), mean_of(square), of_square.low, of_square.high, unit * rms("rms"), name,
        unit * rms("sigma"), name, unit * mean_of(mean), unit * of_mean.low, unit * of_mean.high, name,
        holds ? "holds" : "**off**");
  }
  return text;
}

std::string budget_table(const Study& study) {
  constexpr std::array<Stage, 5> kParts = {{{"head", "head (lenses, rig), pixels kept"},
                                            {"places", "places of the stations"},
                                            {"shared", "both together: they compensate each other"},
                                            {"own", "edge pixels and surface beside them"},
                                            {"total", "all"}}};
  std::string text = "| source | u measured | u predicted | v measured | v predicted |\n| --- | --- | --- | --- | --- |\n";
  for (const Stage& part : kParts) {
    const auto rms = [&](const char* key) {
      return std::sqrt(
          mean_of(values_of(study, [&](const ordered_json& seed) { return seed["budget"][part.key][key].get<double>(); })));
    };
    text += fmt::format("| {} | {:.4f} mm | {:.4f} mm | {:.4f} mm | {:.4f} mm |\n", part.name, rms("u"), rms("predicted_u"),
                        rms("v"), rms("predicted_v"));
  }
  return text;
}

std::string cost_line(const Study& study) {
  const auto of = [&](const char* key) {
    return values_of(study, [&](const ordered_json& seed) { return seed[key].get<double>(); });
  };
  return fmt::format(
      "{} seeds, {} more failed. A seed took {:.0f} s of CPU (median; {:.0f} s of it photographing), largest {:.0f} s; {:.0f} "
      "s on the "
      "clock of a machine that others used, too.\n",
      study.seeds.size(), study.failed, quantile(of("cpu_s"), 0.5), quantile(of("simulate_cpu_s"), 0.5),
      quantile(of("cpu_s"), 1.0), quantile(of("wall_s"), 0.5));
}

/// A plot with one row for each name: a dot for each seed, a band that is expected, a mark at the mean.
class RowPlot {
 public:
  RowPlot(const std::string& title, double low, double high, const std::vector<double>& ticks, std::size_t rows,
          bool logarithmic)
      : low_(low), high_(high), logarithmic_(logarithmic) {
    const double height = kTop + kRow * static_cast<double>(rows) + 36.0;
    svg_ = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1:.0f}\" width=\"{0}\" height=\"{1:.0f}\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
        "<text x=\"10\" y=\"20\" font-size=\"14\">{2}</text>\n",
        kWidth, height, title);
    for (const double tick : ticks) {
      svg_ += fmt::format(
          "<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\" stroke=\"#ccc\"/>\n"
          "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4:g}</text>\n",
          x(tick), kTop, height - 30.0, height - 14.0, tick);
    }
  }
  void row(const std::string& name, const std::vector<double>& dots, double band_low, double band_high, double mean) {
    const double y = kTop + kRow * (static_cast<double>(rows_++) + 0.5);
    svg_ += fmt::format("<text x=\"10\" y=\"{:.1f}\">{}</text>\n", y + 4.0, name);
    svg_ +=
        fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#9c9\" fill-opacity=\"0.6\"/>\n",
                    x(band_low), y - 0.45 * kRow, std::max(1.0, x(band_high) - x(band_low)), 0.9 * kRow);
    for (std::size_t i = 0; i < dots.size(); ++i) {
      const double aside = 0.3 * kRow * (static_cast<double>(i * 7 % 11) / 5.0 - 1.0);
      svg_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"#36c\" fill-opacity=\"0.5\"/>\n", x(dots[i]),
                          y + aside);
    }
    svg_ +=
        fmt::format("<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" y2=\"{2:.1f}\" stroke=\"#c00\" stroke-width=\"2\"/>\n",
                    x(mean), y - 0.45 * kRow, y + 0.45 * kRow);
  }
  [[nodiscard]] std::string str() const { return svg_ + "</svg>\n"; }

 private:
  static constexpr int kWidth = 760;
  static constexpr double kTop = 36.0;
  static constexpr double kRow = 34.0;
  static constexpr double kLeft = 250.0;

  [[nodiscard]] double x(double value) const {
    const auto scale = [&](double v) { return logarithmic_ ? std::log(std::max(v, 1e-9)) : v; };
    const double share = (scale(value) - scale(low_)) / (scale(high_) - scale(low_));
    return kLeft + std::clamp(share, 0.0, 1.0) * (kWidth - 20.0 - kLeft);
  }

  double low_, high_;
  bool logarithmic_;
  std::size_t rows_ = 0;
  std::string svg_;
};

std::string stage_plot(const Study& study) {
  RowPlot plot("Square over its degrees of freedom: seeds, their mean (red), where it should lie (99 %, green)", 0.25, 8.0,
               {0.25, 0.5, 1.0, 2.0, 4.0, 8.0}, kStages.size(), true);
  for (const Stage& stage : kStages) {
    const std::vector<Square> squares = squares_of(study, stage.key);
    const MeanSquare mean = mean_square(squares, kLevel);
    std::vector<double> ratios;
    for (const Square& one : squares) ratios.push_back(one.square / one.dof);
    plot.row(std::string(stage.name).substr(0, std::string(stage.name).find(" (")), ratios, mean.expected.low,
             mean.expected.high, mean.mean);
  }
  return plot.str();
}

std::string coverage_plot(const Study& study) {
  struct Row {
    const char *where, *axis, *key, *name;
    double expected;
  };
  constexpr std::array<Row, 8> kRows = {{{"edge", "u", "in_1", "rim u, 1 sigma", 0.6827},
                                         {"edge", "v", "in_1", "rim v, 1 sigma", 0.6827},
                                         {"path", "u", "in_1", "path u, 1 sigma", 0.6827},
                                         {"path", "v", "in_1", "path v, 1 sigma", 0.6827},
                                         {"edge", "u", "in_2", "rim u, 2 sigma", 0.9545},
                                         {"edge", "v", "in_2", "rim v, 2 sigma", 0.9545},
                                         {"path", "u", "in_2", "path u, 2 sigma", 0.9545},
                                         {"path", "v", "in_2", "path v, 2 sigma", 0.9545}}};
  RowPlot plot("Share of points within their band [%]: seeds, their mean (red), what is claimed (green)", 0.0, 100.0,
               {0.0, 20.0, 40.0, 60.0, 80.0, 100.0}, kRows.size(), false);
  for (const Row& row : kRows) {
    const std::vector<double> shares =
        values_of(study, [&](const ordered_json& seed) { return 100.0 * seed[row.where][row.axis][row.key].get<double>(); });
    plot.row(row.name, shares, 100.0 * row.expected - 0.3, 100.0 * row.expected + 0.3, mean_of(shares));
  }
  return plot.str();
}

std::string all_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// Puts `content` between the line of the name and the next end.
bool replace(std::string& text, const std::string& name, const std::string& content) {
  const std::string begin = fmt::format("<!-- study: {} -->\n", name);
  const std::size_t at = text.find(begin);
  const std::size_t end = text.find("<!-- end -->", at);
  if (at == std::string::npos || end == std::string::npos) {
    fmt::print(stderr, "there is no place for '{}'\n", name);
    return false;
  }
  text.replace(at + begin.size(), end - at - begin.size(), content);
  return true;
}

bool write(const fs::path& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  return static_cast<bool>(stream);
}

}  // namespace

int summarise(const fs::path& lines, const fs::path& docs) {
  const Study study = read(lines);
  if (study.seeds.size() < 2) {
    fmt::print(stderr, "{} holds {} seeds\n", lines.string(), study.seeds.size());
    return 1;
  }
  const std::string cost = cost_line(study), stages = stage_table(study), coverage = coverage_table(study),
                    budget = budget_table(study);
  fmt::print("{}\n{}\n{}\n{}", cost, stages, coverage, budget);
  std::string text = all_of(docs / "accuracy.md");
  const bool placed = replace(text, "cost", cost) && replace(text, "stages", stages) && replace(text, "coverage", coverage) &&
                      replace(text, "budget", budget);
  const bool written = placed && write(docs / "accuracy.md", text) &&
                       write(docs / "pictures" / "accuracy-stages.svg", stage_plot(study)) &&
                       write(docs / "pictures" / "accuracy-coverage.svg", coverage_plot(study));
  return written ? 0 : 1;
}

}  // namespace crosstie::study
