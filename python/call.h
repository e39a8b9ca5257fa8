#pragma once

#include <functional>
#include <type_traits>
#include <utility>

#include <pybind11/pybind11.h>

#include "base/progress.h"
#include "base/result.h"

namespace crosstie::python {

namespace py = pybind11;

/// Adds crosstie.Error and crosstie.ErrorCode to the module.
void add_errors(py::module_& module);

/// Throws crosstie.Error; of a call that was stopped by Ctrl-C KeyboardInterrupt has gone up before.
[[noreturn]] void raise(const base::Error& error);

template <typename T>
T value_of(base::Result<T>&& result) {
  if (!result) raise(result.error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

/// Runs `work` in a thread of its own without the interpreter's lock. This thread looks for signals meanwhile: where their handler
/// throws (Ctrl-C: KeyboardInterrupt), the work is asked to stop, its end awaited, and the exception handed on.
/// `work` touches no Python object.
void run_interruptibly(const std::function<void(const base::Progress&)>& work);

/// The value of `work(progress)`, a Result; its Error becomes crosstie.Error.
template <typename Work>
auto call(Work&& work) {
  using Answer = std::invoke_result_t<Work, const base::Progress&>;
  Answer answer = base::fail(base::ErrorCode::kInternal, "the call gave no answer");
  run_interruptibly([&](const base::Progress& progress) { answer = work(progress); });
  return value_of(std::move(answer));
}

}  // namespace crosstie::python
