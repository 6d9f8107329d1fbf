#pragma once

#include <cmath>
#include <cstdint>

namespace understory {

// Integer coordinates of a voxel in one number, 21 bits each: from -2^20 to 2^20 - 1, which is a
// thousand kilometres at voxels of one metre. Beyond that the coordinates wrap around.
[[nodiscard]] inline std::uint64_t voxel_key(int x, int y, int z) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << 21) - 1;
  return ((static_cast<std::uint64_t>(x) & kMask) << 42) |
         ((static_cast<std::uint64_t>(y) & kMask) << 21) | (static_cast<std::uint64_t>(z) & kMask);
}

// Spreads a key over 64 bits for open addressing; take the low bits.
[[nodiscard]] inline std::uint64_t voxel_hash(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15ULL;
  return key ^ (key >> 32);
}

// floor(value) as an integer, without the call that std::floor is where SSE 4.1 may not be assumed.
[[nodiscard]] inline int voxel_floor(float value) {
  const int truncated = static_cast<int>(value);
  return truncated - static_cast<int>(static_cast<float>(truncated) > value);
}
[[nodiscard]] inline int voxel_floor(double value) {
  const int truncated = static_cast<int>(value);
  return truncated - static_cast<int>(static_cast<double>(truncated) > value);
}

}  // namespace understory
