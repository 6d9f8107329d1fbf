#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "understory/output/clouds/las_stream.h"
#include "understory/output/copc/copc_octree.h"
#include "understory/util/progress.h"

namespace understory {

// NAME.copc.laz beside NAME.laz.
[[nodiscard]] std::filesystem::path copc_path(const std::filesystem::path& laz);

// Whether an octree of cubes suits coordinates with these steps: they are the same along all axes,
// so not degrees beside metres.
[[nodiscard]] bool suits_copc(const LasOptions& options);

// Cloud Optimized Point Cloud 1.0 (https://copc.io): LAZ 1.4 of point format 6 whose chunks are the
// nodes of an octree. A viewer then reads only what it shows. Points wait in memory or on the disk
// (32 bytes each) until `commit` builds the octree, in some 300 MB of memory whatever their number.
// Nodes are compressed in parallel. The file appears with `commit`; it has the same bytes for any
// number of threads. Failures are OutputErrors. Not thread-safe.
class CopcWriter {
 public:
  CopcWriter(const std::filesystem::path& path, const LasOptions& options,
             const CopcShape& shape = {});
  ~CopcWriter();
  CopcWriter(const CopcWriter&) = delete;
  CopcWriter& operator=(const CopcWriter&) = delete;

  void add(const LasPointSteps& point);
  // Throws Stopped, too: there is no file then.
  void commit(const ProgressSink& progress = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
