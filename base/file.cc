#include "base/file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <memory>
#include <system_error>

#include <sys/stat.h>

#include <fmt/format.h>
#include <openssl/evp.h>

#include "base/detail/posix_file.h"

namespace crosstie::base {
namespace {

/// SHA-256 of what is fed to it.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) { EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr); }

  void feed(std::string_view bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }

  std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string result;
    for (unsigned int i = 0; i < size; ++i) fmt::format_to(std::back_inserter(result), "{:02x}", digest[i]);
    return result;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

tl::unexpected<Error> too_large(const std::filesystem::path& path, std::size_t max_bytes) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: larger than the {} bytes that are read", shown(path), max_bytes));
}

}  // namespace

Result<std::string> read_file(const std::filesystem::path& path, std::size_t max_bytes) {
  auto file = detail::open_regular(path);
  if (!file) return fail(std::move(file));
  struct stat status {};
  if (::fstat(file->number(), &status) != 0) return detail::system_failure("read", path, errno);
  const auto expected = static_cast<std::size_t>(std::max<off_t>(status.st_size, 0));
  if (expected > max_bytes) return too_large(path, max_bytes);

  // One byte more than expected, so that the end is seen without another allocation; a growing file is followed.
  std::string contents(expected + 1, '\0');
  std::size_t size = 0;
  for (;;) {
    const long count = detail::read_some(file->number(), contents.data() + size, contents.size() - size);
    if (count < 0) return detail::system_failure("read", path, errno);
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
    if (size > max_bytes) return too_large(path, max_bytes);
    if (size == contents.size()) contents.resize(2 * size + 4096);
  }
  contents.resize(size);
  return contents;
}

Result<> make_folder(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) {
    return fail(ErrorCode::kFileSystem, fmt::format("cannot create the folder {}: {}", shown(path), error.message()));
  }
  if (!std::filesystem::is_directory(path, error)) return detail::system_failure("create the folder", path, ENOTDIR);
  return {};
}

std::string sha256_hex(std::string_view bytes) {
  Sha256 sum;
  sum.feed(bytes);
  return sum.hex();
}

Result<std::string> sha256_of_file(const std::filesystem::path& path) {
  auto file = detail::open_regular(path);
  if (!file) return fail(std::move(file));
  Sha256 sum;
  std::string buffer(std::size_t{1} << 20, '\0');
  for (;;) {
    const long count = detail::read_some(file->number(), buffer.data(), buffer.size());
    if (count < 0) return detail::system_failure("read", path, errno);
    if (count == 0) return sum.hex();
    sum.feed({buffer.data(), static_cast<std::size_t>(count)});
  }
}

std::string shown(const std::filesystem::path& path) {
  std::string result;
  for (const char c : path.native()) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7f) {
      fmt::format_to(std::back_inserter(result), "\\x{:02x}", code);
    } else {
      result += c;
    }
  }
  return result.empty() ? "\"\"" : result;
}

}  // namespace crosstie::base
