#pragma once

#include "understory/pipeline/run_folder/run_outcome.h"

namespace understory {

// What is made of a recording once its scans have their poses. The functions are called once each,
// in this order.
class MapMaker {
 public:
  MapMaker() = default;
  MapMaker(const MapMaker&) = delete;
  MapMaker& operator=(const MapMaker&) = delete;
  virtual ~MapMaker() = default;

  // Poses as all loops together have them.
  virtual void close_loops() = 0;
  // The map at these poses.
  virtual void finish_map() = 0;
  // The trees in it.
  virtual void list_trees() = 0;
  // The files of the run. Throws OutputError.
  [[nodiscard]] virtual RunOutcome write() = 0;
};

}  // namespace understory
