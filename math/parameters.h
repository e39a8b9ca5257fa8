#pragma once

#include <string>
#include <vector>

namespace crosstie::math {

/// Whether a block stays in the reduced normal equations, or is eliminated from them because few observations join it to
/// others.
enum class BlockRole { kKept, kEliminated };

/// Unknowns that belong together: a pose, a point, the free parameters of a lens.
struct ParameterBlock {
  std::string name;                     ///< "camera c043"
  std::vector<std::string> components;  ///< "fx [px]", one for each unknown
  BlockRole role = BlockRole::kKept;
  int offset = 0;       ///< of its first unknown in the full vector
  int role_offset = 0;  ///< of its first unknown among those of its role

  [[nodiscard]] int size() const { return static_cast<int>(components.size()); }
};

/// The unknowns of an adjustment in the order in which their blocks were added. Blocks may be empty (nothing is estimated).
class Parameters {
 public:
  /// Returns the index of the new block.
  int add(std::string name, std::vector<std::string> components, BlockRole role);

  [[nodiscard]] const std::vector<ParameterBlock>& blocks() const { return blocks_; }
  [[nodiscard]] const ParameterBlock& block(int index) const { return blocks_[static_cast<std::size_t>(index)]; }
  [[nodiscard]] int size() const { return kept_size_ + eliminated_size_; }
  [[nodiscard]] int kept_size() const { return kept_size_; }
  /// Block name and component of the unknown at `offset` in the full vector: "camera c043 fx [px]".
  [[nodiscard]] std::string label(int offset) const;
  [[nodiscard]] std::vector<std::string> labels() const;

 private:
  std::vector<ParameterBlock> blocks_;
  int kept_size_ = 0;
  int eliminated_size_ = 0;
};

}  // namespace crosstie::math
