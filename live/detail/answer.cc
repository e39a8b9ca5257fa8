#include "live/detail/answer.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace crosstie::live::detail {
namespace {

const char* reason(int status) {
  switch (status) {
    case 408:
      return "Request Timeout";
    case 416:
      return "Range Not Satisfiable";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    default:
      return "Bad Request";
  }
}

}  // namespace

const HeaderFields& common_fields() {
  static const HeaderFields fields = {
      {"Cache-Control", "no-store"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"X-Frame-Options", "DENY"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'"},
      {"Accept-Ranges", "none"},
  };
  return fields;
}

std::string error_body(std::string_view message) {
  const nlohmann::json body = {{"error", message}};
  return body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

int status_of(base::ErrorCode code) {
  switch (code) {
    case base::ErrorCode::kUsage:
      return 400;
    case base::ErrorCode::kBadInput:
      return 422;
    case base::ErrorCode::kNoUniqueSolution:
    case base::ErrorCode::kCancelled:
      return 409;
    case base::ErrorCode::kDevice:
      return 502;
    case base::ErrorCode::kFileSystem:
    case base::ErrorCode::kInternal:
      break;
  }
  return 500;
}

std::string refusal_text(const Refusal& refusal) {
  const std::string body = error_body(refusal.message);
  std::string text =
      fmt::format("HTTP/1.1 {} {}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n",
                  refusal.status, reason(refusal.status), body.size());
  for (const auto& [name, value] : common_fields()) text += fmt::format("{}: {}\r\n", name, value);
  return text + "\r\n" + body;
}

}  // namespace crosstie::live::detail
