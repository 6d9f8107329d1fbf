#include "understory/pipeline/georeferencing/stored_places.h"

#include "understory/map/map_tiles.h"
#include "understory/output/layer_files.h"

namespace understory {

StoredPlaces::StoredPlaces(const LayerFrame& layers)
    : layers_(layers), options_(las_options(layers)) {}

Eigen::Vector3d StoredPlaces::from_world(const Eigen::Vector3d& place) const {
  // As LasWriter rounds and read_las_points reads.
  const Eigen::Vector3d steps =
      (layers_.from_world(place) - options_.offset).cwiseQuotient(options_.scale).array().round();
  return from_layers(options_.offset + options_.scale.cwiseProduct(steps));
}

Eigen::Vector3d StoredPlaces::from_layers(const Eigen::Vector3d& place) const {
  return on_map_grid(layers_.to_world(place));
}

}  // namespace understory
