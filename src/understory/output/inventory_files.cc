#include "understory/output/inventory_files.h"

#include "understory/output/geo_files.h"
#include "understory/output/run_tables.h"

namespace understory {

void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const std::string& crs) {
  write_trees_csv(folder / "trees.csv", inventory.trees);
  write_trees_gpkg(folder / "trees.gpkg", inventory.trees, crs);
  if (!inventory.ground.terrain.empty()) {
    write_geotiff(folder / "dtm.tif", inventory.ground.terrain, crs);
  }
  if (!inventory.canopy.empty()) write_geotiff(folder / "chm.tif", inventory.canopy, crs);
}

void add_to_picture(MapPicture& picture, std::span<const Eigen::Vector3d> points,
                    const GroundModel& ground) {
  for (const Eigen::Vector3d& point : points)
    picture.add(point.x(), point.y(), point.z(), ground.height_above(point));
}

}  // namespace understory
