#pragma once

#include <filesystem>

#include "base/result.h"

namespace crosstie::app {

/// A result folder in the making: everything is written beside it under a temporary name; commit() puts it in its place in one
/// step. Whatever happens before, the folder holds the old result whole; without commit() nothing is left behind.
class ResultFolder {
 public:
  /// Creates the temporary folder (and the parents of `target`). Temporary folders that a killed process left are removed.
  /// What stands at `target` is replaced where it is an empty folder, an earlier result, or `may_replace` says so.
  static base::Result<ResultFolder> begin(const std::filesystem::path& target,
                                          bool (*may_replace)(const std::filesystem::path&) = nullptr);

  ResultFolder(ResultFolder&& other) noexcept;
  ResultFolder& operator=(ResultFolder&&) = delete;
  ResultFolder(const ResultFolder&) = delete;
  ResultFolder& operator=(const ResultFolder&) = delete;
  ~ResultFolder();

  /// Where to write.
  [[nodiscard]] const std::filesystem::path& path() const { return staging_; }
  /// Takes a file of the old result over, by its name; false where there is none.
  bool keep(const std::filesystem::path& name) const;
  base::Result<> commit();

  /// Removes what a killed process left beside a result; nothing where another process is about to write it.
  static void clear_leftovers(const std::filesystem::path& target);
  /// Ends the process at once, without folders in the making: results that are being put in their places are there before or not at all.
  [[noreturn]] static void abandon_all(int exit_code);

 private:
  ResultFolder() = default;
  std::filesystem::path target_;
  std::filesystem::path staging_;
  int lock_ = -1;  ///< held while the folder is in the making: two processes do not write one result
};

}  // namespace crosstie::app
