#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "understory/geometry/points.h"
#include "understory/map/keyframe_clouds.h"
#include "understory/util/time.h"

namespace understory {

// The thinned clouds of all keyframes: on disk, the last used ones in memory. Thread-safe.
class KeyframePoints {
 public:
  KeyframePoints(const std::filesystem::path& file, std::size_t keep, std::size_t cached);
  void append(TimeNs stamp, const Points& points);
  void flush();
  [[nodiscard]] std::shared_ptr<const Points> get(std::size_t keyframe);
  // Frees what is in memory; everything can still be got.
  void forget();

 private:
  struct Entry {
    std::shared_ptr<const Points> points;
    std::uint64_t used = 0;
  };
  void remember(std::size_t keyframe, std::shared_ptr<const Points> points);

  mutable std::mutex mutex_;
  KeyframeClouds clouds_;
  std::size_t cached_;
  std::uint64_t uses_ = 0;
  std::unordered_map<std::size_t, Entry> cache_;
};

}  // namespace understory
