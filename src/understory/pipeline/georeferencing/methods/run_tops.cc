#include "understory/pipeline/georeferencing/methods/run_tops.h"

#include <cmath>
#include <limits>

#include "understory/features/tree_tops.h"
#include "understory/georeference/terrain_file.h"

namespace understory {
namespace {

constexpr double kEverywhere = std::numeric_limits<double>::max();

}  // namespace

std::vector<Tree> tops_of_run(const std::filesystem::path& folder, const MovableRun& run) {
  std::vector<Tree> trees;
  // Sizes of crowns are in metres, so a layer in feet or degrees does not do.
  if (!std::filesystem::exists(folder / "chm.tif") || run.layers->units_per_metre() != 1.0)
    return trees;
  const PlaneArea all{Eigen::Vector2d::Constant(-kEverywhere),
                      Eigen::Vector2d::Constant(kEverywhere)};
  const Raster canopy = read_terrain(folder / "chm.tif", all, std::nullopt);
  Raster ground;
  if (std::filesystem::exists(folder / "dtm.tif"))
    ground = read_terrain(folder / "dtm.tif", all, std::nullopt);
  for (const CanopyTop& top : find_canopy_tops(canopy, {})) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    const double below =
        ground.empty() ? Tree::kUnknown : ground.interpolate(top.at.x(), top.at.y());
    const bool known = std::isfinite(below);
    const Eigen::Vector3d at =
        run.layers->to_world({top.at.x(), top.at.y(), known ? below : canopy.z0});
    tree.x = at.x();
    tree.y = at.y();
    tree.z = known ? at.z() : Tree::kUnknown;
    tree.height_m = top.height_m;
    trees.push_back(tree);
  }
  return trees;
}

}  // namespace understory
