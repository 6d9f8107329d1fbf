#pragma once

#include <Eigen/Core>

#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/las_stream.h"

namespace understory {

// Places of a run's map as map.laz gives them back. `map` looks for trees in these places, not in
// the finer ones that it measured, so `inventory RUN` finds the same trees. Not thread-safe.
class StoredPlaces {
 public:
  // `layers`, the frame of map.laz, must outlive it.
  explicit StoredPlaces(const LayerFrame& layers);

  // A place of the world frame, metres: in the world frame again, moved by less than 1.5 mm.
  [[nodiscard]] Eigen::Vector3d from_world(const Eigen::Vector3d& place) const;
  // A place as read from map.laz, in the frame of the layers: in the world frame, metres.
  [[nodiscard]] Eigen::Vector3d from_layers(const Eigen::Vector3d& place) const;

 private:
  const LayerFrame& layers_;
  LasOptions options_;
};

}  // namespace understory
