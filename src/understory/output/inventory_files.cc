#include "understory/output/inventory_files.h"

#include "understory/output/layers/crown_outlines.h"
#include "understory/output/layers/geo_files.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/run_tables.h"

namespace understory {

void write_tree_tables(const std::filesystem::path& folder, const InventoryResult& inventory) {
  write_trees_csv(folder / "trees.csv", inventory.trees);
  if (inventory.dead_wood) write_dead_wood(folder / "dead_wood.csv", *inventory.dead_wood);
  if (inventory.curves.empty()) return;
  write_stem_curves(folder / "stem_curves.csv", inventory.trees, inventory.curves,
                    inventory.origin.head<2>());
}

void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const std::string& crs, const std::vector<StandPlot>& plots) {
  write_tree_tables(folder, inventory);
  TreeLayers layers;
  layers.look_again = looks_in(LayerFrame(), inventory.look_again);
  layers.plots = plots;
  layers.crowns = crown_outlines(inventory);
  layers.dead_wood = dead_wood_in(LayerFrame(), inventory);
  write_trees_gpkg(folder / "trees.gpkg", inventory.trees, crs, layers);
  if (!inventory.ground.terrain.empty()) {
    write_geotiff(folder / "dtm.tif", inventory.ground.terrain, crs);
  }
  if (inventory.canopy.empty()) return;
  write_geotiff(folder / "chm.tif", inventory.canopy, crs);
  write_geotiff(folder / "dsm.tif", absolute_heights(inventory.ground.terrain, inventory.canopy),
                crs);
}

void write_inventory_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                           const LayerFrame& layers, const std::vector<StandPlot>& plots) {
  write_tree_tables(folder, inventory);
  write_tree_layers(folder, inventory, {}, layers, plots);
  write_raster_layers(folder, inventory.ground.terrain, inventory.canopy, change_into(layers),
                      layers);
}

void write_slice_files(const std::filesystem::path& folder, const InventoryResult& inventory,
                       const std::string& crs) {
  write_tree_tables(folder, inventory);
  write_trees_gpkg(folder / "trees.gpkg", inventory.trees, crs);
}

void add_to_picture(MapPicture& picture, std::span<const Eigen::Vector3d> points,
                    const GroundModel& ground, const LayerFrame& drawing) {
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d at = drawing.from_world(point);
    picture.add(at.x(), at.y(), at.z(), ground.height_above(point));
  }
}

}  // namespace understory
