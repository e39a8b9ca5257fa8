#include "app/job_table.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>
#include <fmt/ranges.h>
#define TOML_EXCEPTIONS 0
#define TOML_ASSERT(expr) static_assert(true)  // base/toml_guard.h
#include <toml++/toml.h>

#include "base/text.h"
#include "base/toml_guard.h"

namespace crosstie::app {

using base::ErrorCode;
using base::Result;

struct JobTable::File {
  std::filesystem::path path;
  toml::table root;
  std::optional<base::Error> error;

  void complain(const toml::node* node, std::string_view message) {
    if (error) return;
    const std::string where = node != nullptr && node->source().begin.line > 0
                                  ? fmt::format("{}:{}", path.string(), node->source().begin.line)
                                  : path.string();
    error = base::Error{ErrorCode::kBadInput, fmt::format("{}: {}", where, base::toml_message(message))};
  }
};

namespace {

const toml::table& as_table(const void* table) { return *static_cast<const toml::table*>(table); }

std::optional<int> as_int(const toml::node& node) {
  const auto* whole = node.as_integer();
  if (whole == nullptr || whole->get() < std::numeric_limits<int>::min() || whole->get() > std::numeric_limits<int>::max()) {
    return std::nullopt;
  }
  return static_cast<int>(whole->get());
}

const char* domain_text(Domain domain) {
  switch (domain) {
    case Domain::kPositive:
      return "a positive number";
    case Domain::kNotNegative:
      return "0 or a positive number";
    case Domain::kAny:
      break;
  }
  return "a number";
}

bool lies_in(double value, Domain domain) {
  if (!std::isfinite(value)) return false;
  return domain == Domain::kAny || (domain == Domain::kPositive ? value > 0.0 : value >= 0.0);
}

}  // namespace

Result<JobTable> JobTable::parse(const std::filesystem::path& file, const std::string& text) {
  if (const auto fault = base::toml_fault(text))
    return base::fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", file.string(), fault->line, fault->what));
  toml::parse_result parsed = toml::parse(text, file.string());
  if (!parsed) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", file.string(), parsed.error().source().begin.line,
                                                        base::toml_message(parsed.error().description())));
  }
  auto held = std::make_shared<File>(File{file, std::move(parsed).table(), {}});
  const void* root = &held->root;
  return JobTable(std::move(held), root);
}

const std::optional<base::Error>& JobTable::error() const { return file_->error; }

void JobTable::complain(std::string_view key, std::string_view message) const {
  const toml::node* node = key.empty() ? nullptr : as_table(table_).get(key);
  file_->complain(node != nullptr ? node : &as_table(table_), message);
}

void JobTable::check_keys(std::string_view section, std::initializer_list<std::string_view> known) const {
  const std::vector<std::string> names(known.begin(), known.end());
  for (const auto& [key, node] : as_table(table_)) {
    const std::string name(key.str());
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const auto meant = base::nearest_word(name, names);
    file_->complain(
        &node, fmt::format(
                   "unknown key '{}' in {}{}", name, section.empty() ? "the job" : fmt::format("[{}]", section),
                   meant ? fmt::format(", did you mean '{}'?", *meant) : fmt::format("; it knows {}", fmt::join(names, ", "))));
  }
}

bool JobTable::has(std::string_view key) const { return as_table(table_).contains(key); }

void JobTable::text(std::string_view key, std::string& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  if (const auto* found = node->as_string()) {
    value = found->get();
    return;
  }
  complain(key, fmt::format("{} must be a text in quotes", key));
}

void JobTable::word(std::string_view key, std::initializer_list<std::string_view> words, std::string& value) const {
  if (!has(key)) return;
  std::string found;
  text(key, found);
  if (std::find(words.begin(), words.end(), found) == words.end()) {
    const std::vector<std::string> names(words.begin(), words.end());
    const auto meant = base::nearest_word(found, names);
    return complain(key, fmt::format("{} must be one of {}, not '{}'{}", key, fmt::join(names, ", "), found,
                                     meant ? fmt::format("; did you mean '{}'?", *meant) : ""));
  }
  value = found;
}

void JobTable::path(std::string_view key, std::optional<std::filesystem::path>& value) const {
  std::string found;
  text(key, found);
  if (!found.empty()) value = found;
}

void JobTable::number(std::string_view key, std::optional<double>& value, Domain domain) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  const std::optional<double> found = node->is_number() ? node->value<double>() : std::nullopt;
  if (!found || !lies_in(*found, domain)) return complain(key, fmt::format("{} must be {}", key, domain_text(domain)));
  value = found;
}

void JobTable::number(std::string_view key, double& value, Domain domain) const {
  std::optional<double> found;
  number(key, found, domain);
  value = found.value_or(value);
}

void JobTable::triple(std::string_view key, std::optional<Eigen::Vector3d>& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  Eigen::Vector3d found = Eigen::Vector3d::Constant(std::nan(""));
  if (list != nullptr && list->size() == 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      const toml::node& one = (*list)[i];
      if (one.is_number()) found(static_cast<Eigen::Index>(i)) = one.value<double>().value_or(std::nan(""));
    }
  }
  if (!found.allFinite()) return complain(key, fmt::format("{} must be three numbers, such as [0, 0, 1]", key));
  value = found;
}

void JobTable::flag(std::string_view key, bool& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  if (const auto* found = node->as_boolean()) {
    value = found->get();
    return;
  }
  complain(key, fmt::format("{} must be true or false", key));
}

void JobTable::date(std::string_view key, std::optional<std::chrono::year_month_day>& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  std::string written;
  if (const auto* day = node->as_date()) {
    written = fmt::format("{:04}-{:02}-{:02}", day->get().year, int{day->get().month}, int{day->get().day});
  } else if (const auto* words = node->as_string()) {
    written = words->get();
  }
  const auto parsed = base::parse_date(written);
  if (!parsed) return complain(key, fmt::format("{} must be a date such as \"2026-05-31\"", key));
  value = *parsed;
}

void JobTable::texts(std::string_view key, std::vector<std::string>& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr) return complain(key, fmt::format("{} must be a list of texts in quotes", key));
  for (const toml::node& item : *list) {
    if (!item.is_string()) return file_->complain(&item, fmt::format("{} must be a list of texts in quotes", key));
    value.push_back(item.as_string()->get());
  }
}

void JobTable::words(std::string_view key, std::vector<std::string>& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr) return complain(key, fmt::format("{} must be a list such as [\"0-127\"]", key));
  for (const toml::node& item : *list) {
    if (const auto* written = item.as_string()) {
      value.push_back(written->get());
    } else if (const auto* whole = item.as_integer()) {
      value.push_back(fmt::format("{}", whole->get()));
    } else {
      return file_->complain(&item, fmt::format("{} holds ids and ranges such as \"0-127\"", key));
    }
  }
}

void JobTable::pair(std::string_view key, std::optional<std::pair<int, int>>& value) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list != nullptr && list->empty()) return;
  const auto first = list != nullptr && list->size() == 2 ? as_int((*list)[0]) : std::nullopt;
  const auto second = first ? as_int((*list)[1]) : std::nullopt;
  if (!second) return complain(key, fmt::format("{} must be two whole numbers, such as [11, 52]", key));
  value = {*first, *second};
}

void JobTable::certificate(std::string_view prefix, base::Certificate& value) const {
  text(prefix, value.number);
  date(fmt::format("{}_date", prefix), value.issued);
  date(fmt::format("{}_expires", prefix), value.valid_until);
  if (const auto valid = value.validate(); !valid) complain(fmt::format("{}_expires", prefix), valid.error().message);
}

std::optional<JobTable> JobTable::table(std::string_view key) const {
  const toml::node* node = as_table(table_).get(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) {
    complain(key, fmt::format("{} must be a table, [{}]", key, key));
    return std::nullopt;
  }
  return JobTable(file_, node->as_table());
}

std::vector<JobTable> JobTable::tables(std::string_view key) const {
  const toml::node* node = as_table(table_).get(key);
  std::vector<JobTable> entries;
  if (node == nullptr) return entries;
  const toml::array* list = node->as_array();
  if (list != nullptr && list->empty()) return entries;
  if (list == nullptr || !list->is_homogeneous(toml::node_type::table)) {
    complain(key, fmt::format("{} must be tables, [[{}]] each", key, key));
    return entries;
  }
  for (const toml::node& item : *list) entries.push_back(JobTable(file_, item.as_table()));
  return entries;
}

std::vector<std::string> JobTable::keys() const {
  std::vector<std::string> names;
  for (const auto& [key, node] : as_table(table_)) names.emplace_back(key.str());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace crosstie::app
