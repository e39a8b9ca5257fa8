#include "math/parameters.h"

#include <cassert>
#include <utility>

namespace crosstie::math {

int Parameters::add(std::string name, std::vector<std::string> components, BlockRole role) {
  ParameterBlock block{std::move(name), std::move(components), role, size(), 0};
  int& role_size = role == BlockRole::kKept ? kept_size_ : eliminated_size_;
  block.role_offset = role_size;
  role_size += block.size();
  blocks_.push_back(std::move(block));
  return static_cast<int>(blocks_.size()) - 1;
}

std::string Parameters::label(int offset) const {
  for (const ParameterBlock& block : blocks_) {
    if (offset >= block.offset && offset < block.offset + block.size()) {
      return block.name + " " + block.components[static_cast<std::size_t>(offset - block.offset)];
    }
  }
  assert(false);
  return {};
}

std::vector<std::string> Parameters::labels() const {
  std::vector<std::string> result;
  result.reserve(static_cast<std::size_t>(size()));
  for (const ParameterBlock& block : blocks_) {
    for (const std::string& component : block.components) result.push_back(block.name + " " + component);
  }
  return result;
}

}  // namespace crosstie::math
