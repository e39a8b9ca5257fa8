#include "python/call.h"

#include <chrono>
#include <exception>
#include <future>
#include <optional>
#include <thread>

#include <pybind11/stl.h>

namespace crosstie::python {
namespace {

using base::ErrorCode;

constexpr auto kLookForSignals = std::chrono::milliseconds(50);

/// Lives as long as the interpreter.
PyObject* error_type = nullptr;

}  // namespace

void add_errors(py::module_& module) {
  py::dict codes;
  for (const auto& [name, code] : {std::pair{"USAGE", ErrorCode::kUsage},
                                   {"BAD_INPUT", ErrorCode::kBadInput},
                                   {"NO_UNIQUE_SOLUTION", ErrorCode::kNoUniqueSolution},
                                   {"FILE_SYSTEM", ErrorCode::kFileSystem},
                                   {"DEVICE", ErrorCode::kDevice},
                                   {"INTERNAL", ErrorCode::kInternal},
                                   {"CANCELLED", ErrorCode::kCancelled}}) {
    codes[name] = static_cast<int>(code);
  }
  py::object error_codes = py::module_::import("enum").attr("IntEnum")("ErrorCode", codes, py::arg("module") = "crosstie");
  error_codes.attr("__doc__") = "Why a call gave no answer; the values are the exit codes of the command line.";
  module.attr("ErrorCode") = error_codes;
  error_type = PyErr_NewExceptionWithDoc(
      "crosstie.Error", "What crosstie cannot answer: str() says what, where, why and what to do; `code` is an ErrorCode.",
      PyExc_RuntimeError, nullptr);
  if (error_type == nullptr) throw py::error_already_set();
  module.attr("Error") = py::reinterpret_borrow<py::object>(error_type);
}

void raise(const base::Error& error) {
  py::object instance = py::reinterpret_borrow<py::object>(error_type)(error.message);
  instance.attr("code") = py::module_::import("crosstie._core").attr("ErrorCode")(static_cast<int>(error.code));
  PyErr_SetObject(error_type, instance.ptr());
  throw py::error_already_set();
}

void run_interruptibly(const std::function<void(const base::Progress&)>& work) {
  std::stop_source stop;
  std::exception_ptr thrown;
  std::optional<py::error_already_set> interruption;
  {
    const py::gil_scoped_release released;
    std::promise<void> ended;
    std::future<void> end = ended.get_future();
    const std::jthread worker([&] {
      try {
        work(base::Progress{{}, stop.get_token()});
      } catch (...) {
        thrown = std::current_exception();
      }
      ended.set_value();
    });
    while (end.wait_for(kLookForSignals) != std::future_status::ready) {
      const py::gil_scoped_acquire held;
      if (PyErr_CheckSignals() == 0) continue;
      if (!interruption) interruption.emplace();
      PyErr_Clear();  // of a second Ctrl-C while the work ends
      stop.request_stop();
    }
  }
  if (interruption) throw py::error_already_set(*interruption);
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace crosstie::python
