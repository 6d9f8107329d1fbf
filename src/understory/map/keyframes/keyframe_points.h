#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "understory/geometry/feature_points.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/util/time.h"

namespace understory {

// The thinned clouds of all keyframes, with their features if they have any: on disk, the last used
// ones in memory. Thread-safe.
class KeyframePoints {
 public:
  // Begins anew, or goes on behind what is `known`.
  KeyframePoints(const std::filesystem::path& file, std::size_t cached);
  KeyframePoints(const std::filesystem::path& file, const RecordCount& known, std::size_t cached);
  void append(TimeNs stamp, const FeaturePoints& cloud);
  // Waits until everything is on the disk.
  void sync();
  [[nodiscard]] RecordCount count() const;
  [[nodiscard]] std::shared_ptr<const FeaturePoints> get(std::size_t keyframe);
  // Frees what is in memory; everything can still be got.
  void forget();

 private:
  struct Entry {
    std::shared_ptr<const FeaturePoints> cloud;
    std::uint64_t used = 0;
  };
  void remember(std::size_t keyframe, std::shared_ptr<const FeaturePoints> cloud);

  mutable std::mutex mutex_;
  KeyframeClouds clouds_;
  std::size_t cached_;
  std::uint64_t uses_ = 0;
  std::unordered_map<std::size_t, Entry> cache_;
};

}  // namespace understory
