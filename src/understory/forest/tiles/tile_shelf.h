#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "understory/util/files/scratch_file.h"

namespace understory {

// A list for each tile, in memory or in a scratch file. Lists of different tiles may be put and
// taken by several threads at once.
template <typename T>
class TileShelf {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // `scratch` outlives this; null: in memory.
  TileShelf(std::size_t tiles, ScratchFile* scratch) : scratch_(scratch), places_(tiles) {}

  void put(std::size_t tile, std::vector<T> list) {
    Place& place = places_[tile];
    place.size = list.size();
    if (scratch_ == nullptr) {
      place.list = std::move(list);
    } else {
      place.part = scratch_->append(list.data(), list.size() * sizeof(T));
    }
  }
  [[nodiscard]] std::vector<T> copy(std::size_t tile) const {
    const Place& place = places_[tile];
    if (scratch_ == nullptr) return place.list;
    std::vector<T> list(place.size);
    scratch_->read(place.part, list.data());
    return list;
  }
  // Leaves an empty list.
  [[nodiscard]] std::vector<T> take(std::size_t tile) {
    if (scratch_ != nullptr) return copy(tile);
    return std::exchange(places_[tile].list, {});
  }

 private:
  struct Place {
    std::size_t size = 0;
    std::vector<T> list;
    ScratchFile::Part part;
  };
  ScratchFile* scratch_;
  std::vector<Place> places_;
};

}  // namespace understory
