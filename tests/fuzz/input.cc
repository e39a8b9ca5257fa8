#include "tests/fuzz/input.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>

#include <unistd.h>

#include "base/file.h"

namespace crosstie::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestMessage = 1200;

class OwnFolder {
 public:
  OwnFolder() {
    const fs::path memory = "/dev/shm";
    std::error_code unknown;
    const bool usable = fs::is_directory(memory, unknown) && ::access(memory.c_str(), W_OK) == 0;
    std::string name = ((usable ? memory : fs::temp_directory_path()) / "crosstie-fuzz-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
  ~OwnFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

void write(const fs::path& path, std::string_view bytes) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  expect(stream.flush().good(), "the input can be written to a file");
}

struct Begin {
  std::size_t line = 0;  ///< where "=== NAME" begins
  std::size_t contents = 0;
  std::string_view name;
};

/// The next file of the input from `from` on.
std::optional<Begin> next_file(std::string_view input, std::size_t from, std::span<const std::string_view> names) {
  constexpr std::string_view kMark = "=== ";
  for (std::size_t at = input.find(kMark, from); at != std::string_view::npos; at = input.find(kMark, at + 1)) {
    const std::string_view rest = input.substr(at + kMark.size());
    for (const std::string_view name : names) {
      if (rest.starts_with(name) && rest.substr(name.size()).starts_with('\n'))
        return Begin{at, at + kMark.size() + name.size() + 1, name};
    }
  }
  return std::nullopt;
}

}  // namespace

void expect(bool holds, std::string_view what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %.*s\n", static_cast<int>(what.size()), what.data());
  std::abort();
}

void expect_sensible(const base::Error& error) {
  const std::string& message = error.message;
  // Other control characters may be quoted: the program escapes them where it prints (base::shown()).
  if (error.code != base::ErrorCode::kBadInput || message.empty() || message.size() > kLongestMessage ||
      message.find('\n') != std::string::npos) {
    std::fprintf(stderr, "error %d of %zu bytes: %s\n", static_cast<int>(error.code), message.size(),
                 base::shown(message.substr(0, kLongestMessage)).c_str());
    expect(false, "an error blames the input on one line");
  }
}

const fs::path& folder() {
  static const OwnFolder own;
  return own.path();
}

fs::path file(std::string_view name, std::string_view bytes) {
  fs::path path = folder() / name;
  write(path, bytes);
  return path;
}

std::size_t choose(std::string_view& input, std::size_t count) {
  if (input.empty()) return 0;
  const auto first = static_cast<unsigned char>(input.front());
  input.remove_prefix(1);
  return first % count;
}

fs::path unpack(std::string_view input, std::span<const std::string_view> names) {
  fs::path in = folder() / "in";
  static const bool made = fs::create_directories(in);
  expect(made, "the folder is a new one");
  for (const std::string_view name : names) ::unlink((in / name).c_str());
  for (auto begin = next_file(input, 0, names); begin;) {
    const auto next = next_file(input, begin->contents, names);
    const std::size_t end = next ? next->line : input.size();
    write(in / begin->name, input.substr(begin->contents, end - begin->contents));
    begin = next;
  }
  return in;
}

}  // namespace crosstie::fuzz
