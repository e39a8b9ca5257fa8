#pragma once

#include <chrono>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/certificate.h"
#include "base/result.h"

namespace crosstie::app {

/// Which numbers a key may have.
enum class Domain { kPositive, kNotNegative, kAny };

/// A table of a job.toml. Its values are read key by key: a key that is absent leaves what it would set as it is, and the first
/// thing that is wrong is remembered for the whole file, with file and line. Paths and texts are taken as they are written.
class JobTable {
 public:
  /// The file's root; an Error with file and line where it is not TOML.
  static base::Result<JobTable> parse(const std::filesystem::path& file, const std::string& text);

  /// What is wrong with the file so far.
  [[nodiscard]] const std::optional<base::Error>& error() const;
  /// At the line of the key, of the table where the key is empty or absent.
  void complain(std::string_view key, std::string_view message) const;
  /// Complains of every key that is not one of these; `section` is how the file names the table, "" its root.
  void check_keys(std::string_view section, std::initializer_list<std::string_view> known) const;

  [[nodiscard]] bool has(std::string_view key) const;
  void text(std::string_view key, std::string& value) const;
  /// One of `words`.
  void word(std::string_view key, std::initializer_list<std::string_view> words, std::string& value) const;
  void path(std::string_view key, std::optional<std::filesystem::path>& value) const;
  void number(std::string_view key, std::optional<double>& value, Domain domain = Domain::kPositive) const;
  void number(std::string_view key, double& value, Domain domain = Domain::kPositive) const;
  /// Three numbers.
  void triple(std::string_view key, std::optional<Eigen::Vector3d>& value) const;
  void flag(std::string_view key, bool& value) const;
  /// "YYYY-MM-DD" in quotes, or a date of TOML.
  void date(std::string_view key, std::optional<std::chrono::year_month_day>& value) const;
  void texts(std::string_view key, std::vector<std::string>& value) const;
  /// Whole numbers and texts, all as texts.
  void words(std::string_view key, std::vector<std::string>& value) const;
  /// Two whole numbers; an empty list is none.
  void pair(std::string_view key, std::optional<std::pair<int, int>>& value) const;

  /// Keys `prefix`, `prefix`_date and `prefix`_expires.
  void certificate(std::string_view prefix, base::Certificate& value) const;

  [[nodiscard]] std::optional<JobTable> table(std::string_view key) const;
  /// The entries of an array of tables, [[key]].
  [[nodiscard]] std::vector<JobTable> tables(std::string_view key) const;
  /// The keys, sorted.
  [[nodiscard]] std::vector<std::string> keys() const;

 private:
  struct File;
  JobTable(std::shared_ptr<File> file, const void* table) : file_(std::move(file)), table_(table) {}

  std::shared_ptr<File> file_;
  const void* table_;  ///< a toml::table of file_
};

}  // namespace crosstie::app
