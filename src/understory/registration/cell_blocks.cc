#include "understory/registration/cell_blocks.h"

namespace understory::internal {
namespace {

constexpr std::size_t kMiddle = 13;  // of the 27 blocks around one and itself

}  // namespace
CellBlocks::Block& CellBlocks::find_or_add(const Place& block) {
  const std::uint32_t found = index_.find(key_of(block));
  if (found != kNone) return blocks_[found];
  const auto number = static_cast<std::uint32_t>(blocks_.size());
  index_.set(key_of(block), number);
  blocks_.emplace_back().at = block;
  for (std::size_t step = 0; step < 27; ++step)
    blocks_[number].beside[step] = index_.find(key_of(neighbour(block, step)));
  link_neighbours(number);
  return blocks_.back();
}

void CellBlocks::link_neighbours(std::uint32_t number) {
  for (std::size_t step = 0; step < 27; ++step) {
    const std::uint32_t other = blocks_[number].beside[step];
    if (other != kNone) blocks_[other].beside[26 - step] = number;
  }
}

// The last block takes the place of the one removed.
void CellBlocks::remove(std::uint32_t number) {
  index_.erase(key_of(blocks_[number].at));
  for (std::size_t step = 0; step < 27; ++step) {
    const std::uint32_t other = blocks_[number].beside[step];
    if (other != kNone) blocks_[other].beside[26 - step] = kNone;
  }
  if (number + 1 != blocks_.size()) {
    blocks_[number] = blocks_.back();
    index_.set(key_of(blocks_[number].at), number);
    blocks_[number].beside[kMiddle] = number;
    link_neighbours(number);
  }
  blocks_.pop_back();
}

void CellBlocks::set(const Place& at, std::uint32_t cell) {
  Block& block = find_or_add(block_of(at));
  const int bit = bit_of(at);
  block.present |= std::uint64_t{1} << bit;
  block.cell[static_cast<std::size_t>(bit)] = cell;
}

void CellBlocks::erase(const Place& at) {
  Block& block = find_or_add(block_of(at));
  block.present &= ~(std::uint64_t{1} << bit_of(at));
  // An empty block goes with the next changes that are forgotten.
  if (block.changed == 0) changed_.push_back(block.at);
}

void CellBlocks::mark_changed(const Place& at) {
  Block& block = find_or_add(block_of(at));
  if (block.changed == 0) changed_.push_back(block.at);
  block.changed |= std::uint64_t{1} << bit_of(at);
}

void CellBlocks::forget_changes() {
  for (const Place& place : changed_) {
    const std::uint32_t number = index_.find(key_of(place));
    if (number == kNone) continue;
    blocks_[number].changed = 0;
    if (blocks_[number].present == 0) remove(number);
  }
  changed_.clear();
}

const std::vector<std::uint32_t>& CellBlocks::touched() {
  touched_.clear();
  ++visit_;
  for (const Place& place : changed_) {
    const std::uint32_t changed = index_.find(key_of(place));
    if (changed == kNone || blocks_[changed].changed == 0) continue;
    for (const std::uint32_t number : blocks_[changed].beside) {
      if (number == kNone || blocks_[number].visit == visit_) continue;
      blocks_[number].visit = visit_;
      touched_.push_back(number);
    }
  }
  return touched_;
}

}  // namespace understory::internal
