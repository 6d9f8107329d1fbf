#include "understory/pipeline/inventory/stand_plots.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::stand_plots;

// Between the layers, where plots are given and drawn, and the world frame of the inventory.
class PlotFrame {
 public:
  PlotFrame(const InventoryResult& inventory, const LayerFrame& layers)
      : layers_(layers), height_m_(inventory.origin.z()) {
    layer_height_ = layers_.from_world(inventory.origin).z();
  }
  [[nodiscard]] Eigen::Vector2d to_world(const Eigen::Vector2d& point) const {
    return layers_.to_world({point.x(), point.y(), layer_height_}).head<2>();
  }
  [[nodiscard]] Eigen::Vector2d from_world(const Eigen::Vector2d& point) const {
    return layers_.from_world({point.x(), point.y(), height_m_}).head<2>();
  }
  [[nodiscard]] bool in_metres() const { return layers_.units_per_metre() == 1.0; }

 private:
  const LayerFrame& layers_;
  double height_m_;
  double layer_height_ = 0.0;
};

// The plane through the terrain of a circle; level where it is not known.
Eigen::Vector2d gradient_in(const Raster& terrain, const Eigen::Vector2d& centre, double radius_m) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const double step = std::max(terrain.cell_m, radius_m / 20.0);
  const double base = terrain.cell_value(centre.x(), centre.y());
  for (double dy = -radius_m; dy <= radius_m; dy += step) {
    for (double dx = -radius_m; dx <= radius_m; dx += step) {
      if (dx * dx + dy * dy > radius_m * radius_m) continue;
      const double z = terrain.cell_value(centre.x() + dx, centre.y() + dy) - base;
      if (!std::isfinite(z)) continue;
      const Eigen::Vector3d row(dx, dy, 1.0);
      normal += row * row.transpose();
      right += z * row;
    }
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  const Eigen::Vector3d plane = solver.solve(right);
  if (solver.info() != Eigen::Success || !plane.allFinite()) return Eigen::Vector2d::Zero();
  return plane.head<2>();
}

PlotShape shape_of(const PlotOutline& outline, const InventoryResult& inventory,
                   const StandTableConfig& config, const PlotFrame& frame) {
  if (outline.rings.empty()) {
    const Eigen::Vector2d centre = frame.to_world(outline.centre);
    Eigen::Matrix2d squeeze = Eigen::Matrix2d::Identity();
    if (config.radius == PlotRadius::kSlope)
      squeeze = slope_squeeze(gradient_in(inventory.ground.terrain, centre, outline.radius_m));
    return circle_plot(outline.id, centre, outline.radius_m, squeeze);
  }
  PlotShape shape;
  shape.id = outline.id;
  shape.kind = "polygon";
  for (const PlaneRing& ring : outline.rings) {
    PlaneRing moved;
    for (const Eigen::Vector2d& point : ring)
      moved.push_back(frame.to_world(point));
    orient(moved, signed_area_m2(ring) > 0.0);
    shape.rings.push_back(std::move(moved));
  }
  return shape;
}

// Corners of what was seen, world frame.
Eigen::Vector4d box_of(const VisibleArea& seen) {
  return {seen.x0, seen.y0, seen.x0 + seen.columns * seen.cell_m,
          seen.y0 + seen.rows * seen.cell_m};
}

// Corners of the cells of which something was seen, world frame; nothing where there is none.
std::optional<Eigen::Vector4d> box_of_seen(const VisibleArea& seen) {
  Eigen::Array4i box(seen.columns, seen.rows, 0, 0);
  for (int row = 0; row < seen.rows; ++row) {
    for (int column = 0; column < seen.columns; ++column) {
      const auto cell = static_cast<std::size_t>(row) * static_cast<std::size_t>(seen.columns) +
                        static_cast<std::size_t>(column);
      if (seen.halves[cell] == 0 || seen.halves[cell] == VisibleArea::kBorder) continue;
      box = {std::min(box[0], column), std::min(box[1], row), std::max(box[2], column + 1),
             std::max(box[3], row + 1)};
    }
  }
  if (box[2] == 0) return std::nullopt;
  return Eigen::Vector4d(seen.x0, seen.y0, seen.x0, seen.y0) +
         seen.cell_m * box.cast<double>().matrix();
}

// The box, along the axes of another frame, that holds a box.
template <typename Change>
std::pair<Eigen::Vector2d, Eigen::Vector2d> corners_of(const Eigen::Vector4d& box,
                                                       const Change& change) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const int corner : {0, 1, 2, 3}) {
    const Eigen::Vector2d point = change({box[corner % 2 == 0 ? 0 : 2], box[corner < 2 ? 1 : 3]});
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  return {low, high};
}

// Where plots would have to lie, in the frame in which they are given.
std::string place_of(const VisibleArea& seen, const PlotFrame& frame) {
  const std::optional<Eigen::Vector4d> box = box_of_seen(seen);
  if (!box) return "no place";
  const auto [low, high] =
      corners_of(*box, [&](const Eigen::Vector2d& point) { return frame.from_world(point); });
  const int decimals = frame.in_metres() ? 0 : 5;
  return fmt::format("x {:.{}f} to {:.{}f}, y {:.{}f} to {:.{}f}", low.x(), decimals, high.x(),
                     decimals, low.y(), decimals, high.y(), decimals);
}

std::vector<PlotShape> grid_of(const VisibleArea& seen, double side_m, const PlotFrame& frame) {
  std::vector<PlotShape> cells;
  if (seen.empty()) return cells;
  const bool in_layers = frame.in_metres();
  const auto to_grid = [&](const Eigen::Vector2d& point) {
    return in_layers ? frame.from_world(point) : point;
  };
  const auto to_world = [&](const Eigen::Vector2d& point) {
    return in_layers ? frame.to_world(point) : point;
  };
  const auto [low, high] = corners_of(box_of(seen), to_grid);
  const Eigen::Vector2d count = ((high - low) / side_m).array().ceil() + 1.0;
  if (count.x() * count.y() > kMostGridCells) return cells;
  const Eigen::Vector2d first = (low / side_m).array().floor();
  for (int row = 0; row < static_cast<int>(count.y()); ++row) {
    for (int column = 0; column < static_cast<int>(count.x()); ++column) {
      const Eigen::Vector2d corner = side_m * (first + Eigen::Vector2d(column, row));
      PlotShape cell;
      cell.id = fmt::format("{:.12g}_{:.12g}", corner.x(), corner.y());
      cell.kind = "cell";
      PlaneRing ring;
      for (const auto& [dx, dy] :
           {std::pair{0.0, 0.0}, std::pair{1.0, 0.0}, std::pair{1.0, 1.0}, std::pair{0.0, 1.0}})
        ring.push_back(to_world(corner + side_m * Eigen::Vector2d(dx, dy)));
      orient(ring, true);
      cell.rings.push_back(std::move(ring));
      cells.push_back(std::move(cell));
    }
  }
  return cells;
}

StandPlot plot_of(PlotShape shape, const StandTrees& trees, const InventoryResult& inventory,
                  const FiguresConfig& config, const PlotFrame& frame) {
  StandPlot plot;
  plot.figures = stand_figures(trees, inventory.seen, shape, config);
  plot.shape = std::move(shape);
  for (const PlaneRing& ring : plot.shape.rings) {
    PlaneRing drawn;
    for (const Eigen::Vector2d& point : ring)
      drawn.push_back(frame.from_world(point));
    plot.drawn.push_back(std::move(drawn));
  }
  return plot;
}

std::string percent(double share) {
  return fmt::format("{:.0f} %", 100.0 * share);
}

// What is to be said of the user's own plots.
void judge_plots(const std::vector<StandPlot>& plots, const StandTableConfig& config,
                 StandResult& result) {
  const StandPlot* least = nullptr;
  const StandPlot* none = nullptr;
  std::size_t in_part = 0;
  std::size_t without = 0;
  for (const StandPlot& plot : plots) {
    if (plot.shape.kind == "cell") continue;
    const double share = plot.figures.seen_share;
    if (share >= kWhole) continue;
    if (share < config.least_seen) {
      ++without;
      if (none == nullptr || share < none->figures.seen_share) none = &plot;
    } else {
      ++in_part;
      if (least == nullptr || share < least->figures.seen_share) least = &plot;
    }
  }
  if (in_part > 0)
    result.remarks.push_back(
        fmt::format("{} beyond what was seen ({} of plot {}). The figures assume that the unseen "
                    "part of a plot is like the seen part.",
                    in_part == 1 ? "1 plot goes" : fmt::format("{} plots go", in_part),
                    percent(least->figures.seen_share), least->shape.id));
  if (without > 0)
    result.complaint = fmt::format(
        "{} no figures: less than {:.0f} % was seen ({} of plot {}). Stems were seen at {}",
        without == 1 ? "1 plot has" : fmt::format("{} plots have", without),
        100.0 * config.least_seen, percent(none->figures.seen_share), none->shape.id,
        result.seen_at);
}

}  // namespace

std::vector<PlotOutline> plots_of(const StandTableConfig& config, const std::string& system) {
  return config.plots.empty() ? std::vector<PlotOutline>{} : read_plots(config.plots, system);
}

void refuse_plots_outside(const StandTableConfig& config, const std::vector<PlotOutline>& plots,
                          const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  if (plots.empty()) return;
  const auto touches = [&](const PlotOutline& plot) {
    Eigen::AlignedBox2d box;
    for (const PlaneRing& ring : plot.rings)
      for (const Eigen::Vector2d& point : ring)
        box.extend(point);
    if (plot.rings.empty()) {
      const Eigen::Vector2d reach = Eigen::Vector2d::Constant(plot.radius_m);
      box = Eigen::AlignedBox2d(plot.centre - reach, plot.centre + reach);
    }
    return box.intersects(Eigen::AlignedBox2d(low, high));
  };
  if (std::any_of(plots.begin(), plots.end(), touches)) return;
  throw InputError(
      config.plots, "",
      fmt::format(
          "expected plots on the cloud, which lies at x {:.0f} to {:.0f}, y {:.0f} to "
          "{:.0f}: {} outside of it",
          low.x(), high.x(), low.y(), high.y(),
          plots.size() == 1 ? "the plot lies" : fmt::format("all {} plots lie", plots.size())));
}

StandResult take_stand(const InventoryResult& inventory, const StandTableConfig& config,
                       const std::vector<PlotOutline>& plots, const LayerFrame& layers) {
  StandResult result;
  const StandTrees trees = stand_trees(inventory.trees, config);
  const FiguresConfig figures{config.class_m, config.min_dbh_m, config.least_seen,
                              config.missed_share};
  const PlotFrame frame(inventory, layers);
  StandTable& table = result.table;
  table.config = config;
  table.curve = trees.curve;
  table.form_factor = trees.form_factor;
  table.without_diameter = trees.without_diameter;
  PlotShape everything;
  everything.kind = "seen";
  table.seen = stand_figures(trees, inventory.seen, everything, figures);
  for (const PlotOutline& outline : plots)
    table.plots.push_back(
        plot_of(shape_of(outline, inventory, config, frame), trees, inventory, figures, frame));
  result.seen_at = place_of(inventory.seen, frame);
  judge_plots(table.plots, config, result);
  if (!(config.grid_m > 0.0)) return result;
  const std::vector<PlotShape> cells = grid_of(inventory.seen, config.grid_m, frame);
  if (cells.empty())
    result.remarks.push_back(
        fmt::format("No grid cells of {:g} m were made: nothing was seen, or they are too many.",
                    config.grid_m));
  for (const PlotShape& shape : cells) {
    StandPlot plot = plot_of(shape, trees, inventory, figures, frame);
    if (plot.figures.seen_m2 > 0.0) table.plots.push_back(std::move(plot));
  }
  return result;
}

}  // namespace understory
