#include "understory/pipeline/georeferencing/methods/run_tops.h"

#include <cmath>
#include <limits>

#include "understory/features/tree_tops.h"
#include "understory/geometry/plane/plane_grid.h"
#include "understory/georeference/terrain_file.h"
#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::run_tops;

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

std::vector<Tree> without_overtopped(const std::vector<Tree>& trees) {
  SparsePoints places;
  for (const Tree& tree : trees)
    places.emplace_back(tree.x, tree.y, 0.0);
  const PlaneGrid grid(places);
  std::vector<Tree> kept;
  for (std::size_t i = 0; i < trees.size(); ++i) {
    bool overtopped = false;
    grid.around(places[i], kOvertopReachM, [&](int other) {
      const auto j = static_cast<std::size_t>(other);
      overtopped |= (places[j] - places[i]).norm() < kOvertopReachM &&
                    trees[j].height_m > trees[i].height_m + kClearlyHigherM;
    });
    if (!overtopped) kept.push_back(trees[i]);
  }
  return kept;
}

}  // namespace understory
