#pragma once

#include <string>
#include <utility>

#include <tl/expected.hpp>

namespace crosstie::base {

/// Why an operation gave no answer. The values are the exit codes of the command line (docs/cli.md).
enum class ErrorCode {
  kUsage = 2,             ///< the call itself is wrong: unknown option, contradictory options
  kBadInput = 3,          ///< a file or a measurement is damaged, inconsistent or out of its domain
  kNoUniqueSolution = 4,  ///< the observations do not determine what was asked for
  kFileSystem = 5,        ///< a file cannot be opened, read, written or renamed
  kDevice = 6,            ///< a camera, projector or axis did not answer
  kInternal = 70,         ///< a defect of crosstie or of a library it calls
  kCancelled = 130,       ///< stopped by the caller
};

/// What went wrong, where (file:line, image or id), why, and what to do about it, in one sentence or two.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
};

template <typename T = void>
using Result = tl::expected<T, Error>;

/// `return fail(ErrorCode::kBadInput, fmt::format(...));` from any function that returns a Result.
[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(message)});
}

/// Hands the error of one Result on as the error of another.
template <typename T>
[[nodiscard]] tl::unexpected<Error> fail(Result<T>&& failed) {
  return tl::unexpected<Error>(std::move(failed).error());
}

/// Something the user should know although there is an answer. Libraries print nothing; warnings travel in the results.
struct Warning {
  std::string code;     ///< stable, for programs: "few_rays", "planar_network"
  std::string subject;  ///< what it is about: a point id, an image, a file
  std::string message;  ///< for people: what, why, what to do
};

}  // namespace crosstie::base
