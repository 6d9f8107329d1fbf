#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/voxel_key.h"

namespace understory {

// Where the voxel with a key is in an array: open addressing, at most half full. Readers may share
// it between threads while nobody writes.
class VoxelIndex {
 public:
  static constexpr std::uint32_t kNone = UINT32_MAX;

  // The value of a key, or kNone.
  [[nodiscard]] std::uint32_t find(std::uint64_t key) const {
    const Slot& slot = slots_[place_of(key)];
    return slot.value_plus_1 - 1;  // free: 0 - 1 = kNone
  }
  // Asks for the memory that find() will look at first.
  void prefetch(std::uint64_t key) const {
    __builtin_prefetch(slots_.data() + (voxel_hash(key) & mask_));
  }
  // Adds a key that is not there, or gives it another value. Values are below kNone.
  void set(std::uint64_t key, std::uint32_t value) {
    Slot& slot = slots_[place_of(key)];
    if (slot.value_plus_1 == 0 && 2 * ++size_ > slots_.size()) {
      grow();
      slots_[place_of(key)] = {key, value + 1};
    } else {
      slot = {key, value + 1};
    }
  }
  // Removes a key that is there.
  void erase(std::uint64_t key) {
    std::size_t hole = place_of(key);
    // What follows without a gap moves up if the hole lies on its way.
    for (std::size_t i = (hole + 1) & mask_; slots_[i].value_plus_1 != 0; i = (i + 1) & mask_) {
      const std::size_t home = voxel_hash(slots_[i].key) & mask_;
      if (((i - home) & mask_) < ((i - hole) & mask_)) continue;
      slots_[hole] = slots_[i];
      hole = i;
    }
    slots_[hole] = {};
    --size_;
  }
  void clear() {
    slots_.assign(kSmallest, {});
    mask_ = kSmallest - 1;
    size_ = 0;
  }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t value_plus_1 = 0;  // 0: free
  };
  static constexpr std::size_t kSmallest = 16;

  // Where the key is, or the free place where it would go.
  [[nodiscard]] std::size_t place_of(std::uint64_t key) const {
    std::size_t i = voxel_hash(key) & mask_;
    while (slots_[i].value_plus_1 != 0 && slots_[i].key != key)
      i = (i + 1) & mask_;
    return i;
  }
  void grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    mask_ = slots_.size() - 1;
    for (const Slot& slot : old) {
      if (slot.value_plus_1 != 0) slots_[place_of(slot.key)] = slot;
    }
  }

  std::vector<Slot> slots_ = std::vector<Slot>(kSmallest);
  std::uint64_t mask_ = kSmallest - 1;
  std::size_t size_ = 0;
};

}  // namespace understory
