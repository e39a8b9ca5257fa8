#include "live/detail/exchange.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>
#include <httplib.h>  // the only source that sees it

#include "live/detail/results.h"

namespace crosstie::live::detail {
namespace {

using httplib::Request;
using httplib::Response;

constexpr std::string_view kJson = "application/json";

/// The connection as the HTTP library sees it.
class Wire final : public httplib::Stream {
 public:
  explicit Wire(Connection& connection) : connection_(connection) {}

  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }
  ssize_t read(char* data, std::size_t size) override { return connection_.read(data, size); }
  ssize_t write(const char* data, std::size_t size) override {
    return connection_.write({data, size}) ? static_cast<ssize_t>(size) : -1;
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip.clear();
    port = 0;
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    ip = connection_.local_address();
    port = 0;
  }
  [[nodiscard]] socket_t socket() const override {
    return 0;
  }  // used to ask whether select() could take it; nobody selects here

 private:
  Connection& connection_;
};

std::vector<std::string> values(const Request& request, const std::string& name) {
  std::vector<std::string> found;
  const auto [begin, end] = request.headers.equal_range(name);
  for (auto one = begin; one != end; ++one) found.push_back(one->second);
  return found;
}

void set_field(Response& response, const std::string& name, const std::string& value) {
  response.headers.erase(name);
  response.set_header(name, value);
}

void set_json(Response& response, int status, const std::string& body) {
  response.status = status;
  response.set_content(body, std::string(kJson));
}

void set_refusal(Response& response, const Refusal& refusal) {
  set_json(response, refusal.status, error_body(refusal.message));
  if (!refusal.allow.empty()) set_field(response, "Allow", refusal.allow);
  if (refusal.status == 503) set_field(response, "Retry-After", "1");
}

/// Whether the field If-None-Match names this tag.
bool has_tag(const std::vector<std::string>& fields, const std::string& tag) {
  return std::any_of(fields.begin(), fields.end(), [&](const std::string& field) {
    return field == "*" || field.find(tag) != std::string::npos;  // the tag has quotes of its own
  });
}

/// The library's server for one request: it parses, decodes and frames; accepting, waiting and limits are ours.
class Exchange final : public httplib::Server {
 public:
  Exchange(Connection& connection, Site& site, Slot& slot) : connection_(connection), site_(site), slot_(slot) {
    svr_sock_ = 0;  // as long as it is valid the library lets streams go on; it is never used
    httplib::Headers fields;
    for (const auto& [name, value] : common_fields()) fields.emplace(name, value);
    set_default_headers(std::move(fields));
    set_expect_100_continue_handler([this](const Request& request, Response& response) {
      const auto refusal = refuse(request);
      if (refusal) set_refusal(response, *refusal);
      return refusal ? refusal->status : 100;
    });
    set_pre_routing_handler([this](const Request& request, Response& response) { return answer(request, response); });
    Post("/command",
         [this](const Request&, Response& response, const httplib::ContentReader& body) { command(body, response); });
    set_exception_handler([](const Request&, Response& response, std::exception_ptr) {
      set_json(response, 500, error_body("the program failed to answer; this is a defect of it"));
    });
    set_post_routing_handler([](const Request&, Response& response) {
      if (response.status == 304) response.headers.erase("Content-Length");
    });
  }

  void run() {
    Wire wire(connection_);
    bool closed = false;
    process_request(wire, true, closed, [](Request& request) {
      // What would make the library unpack, split or pack contents.
      for (const char* name : {"Accept-Encoding", "Content-Encoding", "Content-Type"}) request.headers.erase(name);
      request.ranges.clear();
    });
  }

 private:
  [[nodiscard]] std::optional<Refusal> refuse(const Request& request) const {
    return site_.guard.refuse({.method = request.method,
                               .path = request.path,
                               .local_address = request.local_addr,
                               .hosts = values(request, "Host"),
                               .origins = values(request, "Origin"),
                               .tokens = values(request, "X-Crosstie-Token"),
                               .lengths = values(request, "Content-Length"),
                               .codings = values(request, "Transfer-Encoding")});
  }

  HandlerResponse answer(const Request& request, Response& response) {
    if (const auto refusal = refuse(request)) {
      set_refusal(response, *refusal);
      return HandlerResponse::Handled;
    }
    const Target target = *target_of(request.path);
    switch (target.kind) {
      case Target::Kind::kPage:
        response.set_content(site_.page.data(), site_.page.size(), "text/html; charset=utf-8");
        set_field(response, "Content-Security-Policy", site_.page_policy);
        break;
      case Target::Kind::kState:
        newest(site_.feed.state, kJson, "state", response);
        break;
      case Target::Kind::kPicture:
        newest(site_.feed.pictures.at(target.side), "image/jpeg", "picture", response);
        break;
      case Target::Kind::kScene:
        scene(request, response);
        break;
      case Target::Kind::kEvents:
        stream(request, response, kEventsType,
               [this](const StreamSink& sink) { send_events(site_.feed.state, site_.pace, site_.stop, sink); });
        break;
      case Target::Kind::kStream:
        stream(request, response, kPicturesType, [this, side = target.side](const StreamSink& sink) {
          send_pictures(site_.feed.pictures.at(side), site_.stop, sink);
        });
        break;
      case Target::Kind::kIcon:
        response.status = 204;  // browsers ask for one; there is none
        break;
      case Target::Kind::kResult:
        result(target.file, response);
        break;
      case Target::Kind::kCommand:
        return HandlerResponse::Unhandled;  // on to command()
    }
    return HandlerResponse::Handled;
  }

  static void newest(const Newest<std::string>& from, std::string_view type, const char* what, Response& response) {
    if (auto found = from.newest()) {
      response.set_content(found->value, std::string(type));
    } else {
      set_refusal(response, {503, fmt::format("there is no {} yet", what)});
    }
  }

  void scene(const Request& request, Response& response) const {
    const auto found = site_.feed.scene.newest();
    if (!found) return set_refusal(response, {503, "there is no scene yet"});
    const std::string tag = fmt::format("\"{}-{}\"", site_.scene_tag, found->version);
    set_field(response, "ETag", tag);
    if (has_tag(values(request, "If-None-Match"), tag)) {
      response.status = 304;
    } else {
      response.set_content(found->value, std::string(kJson));
    }
  }

  /// `send` runs until the stream's end, after the head of the answer.
  void stream(const Request& request, Response& response, std::string_view type, std::function<void(const StreamSink&)> send) {
    const auto place = std::make_shared<Slot>();
    if (request.method != "HEAD") {
      *place = site_.streams.take();
      if (!place->taken()) return set_refusal(response, {503, "too many windows show this page: close one"});
      slot_.release();
    }
    response.set_content_provider(std::string(type), [this, place, send = std::move(send)](std::size_t, httplib::DataSink&) {
      send({.write = [this](std::string_view bytes) { return connection_.write(bytes); },
            .alive = [this] { return !connection_.closed_by_client(); }});
      return false;
    });
  }

  void result(const std::string& path, Response& response) const {
    auto found = open_result(site_.results, path);
    if (!found) return set_refusal(response, {404, "the results hold no such file"});
    set_field(response, "Content-Security-Policy", found->policy);
    // A report in its sandbox is of another origin, and shows pictures that lie beside it.
    response.headers.erase("Cross-Origin-Resource-Policy");
    if (found->size == 0) return response.set_content("", found->type);  // the library gives such a provider no length
    const auto file = std::make_shared<ResultFile>(std::move(*found));
    response.set_content_provider(
        file->size, file->type, [file](std::size_t offset, std::size_t size, httplib::DataSink& sink) {
          std::array<char, 65'536> bytes;
          const ssize_t count =
              ::pread(file->file.number(), bytes.data(), std::min(size, bytes.size()), static_cast<off_t>(offset));
          return count > 0 && sink.write(bytes.data(), static_cast<std::size_t>(count));
        });
  }

  void command(const httplib::ContentReader& read, Response& response) {
    std::string body;
    bool too_long = false;
    const bool complete = read([&](const char* data, std::size_t size) {
      too_long = size > kMaxBodyBytes - body.size();
      if (!too_long) body.append(data, size);
      return !too_long;
    });
    if (too_long) return set_refusal(response, {413, "a command has 64 KiB at most"});
    if (connection_.body_was_slow()) return set_refusal(response, {408, "the command did not come in time"});
    if (!complete) return set_refusal(response, {400, "the command's body is damaged or too long"});
    const std::lock_guard lock(site_.handling);
    if (const auto done = site_.handler(body); !done) {
      set_json(response, status_of(done.error().code), error_body(done.error().message));
    } else {
      set_json(response, 202, "{\"accepted\": true}\n");
    }
  }

  Connection& connection_;
  Site& site_;
  Slot& slot_;
};

/// What is refused before the HTTP library sees it; nothing where there is nobody to tell.
std::optional<Refusal> refuse_early(Connection::Head read, std::string_view head) {
  switch (read) {
    case Connection::Head::kSlow:
      return Refusal{408, "the request did not come in time"};
    case Connection::Head::kTooLong:
      return Refusal{431, "the head of a request has 16 KiB at most"};
    case Connection::Head::kComplete:
      return refuse_head(head);
    case Connection::Head::kNone:
      break;
  }
  return std::nullopt;
}

}  // namespace

void exchange(Connection& connection, Site& site, Slot& slot) {
  const Connection::Head head = connection.read_head();
  if (const auto refusal = refuse_early(head, connection.head())) {
    connection.write(refusal_text(*refusal));
  } else if (head == Connection::Head::kComplete) {
    Exchange(connection, site, slot).run();
  }
}

}  // namespace crosstie::live::detail
