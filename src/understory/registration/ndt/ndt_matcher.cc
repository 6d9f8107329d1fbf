#include "understory/registration/ndt/ndt_matcher.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "understory/registration/registration_constants.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace registration_constants::ndt_matcher;

class NdtCost : public MatchCost {
 public:
  NdtCost(const NdtMap& map, const NdtMap* coarser, const NdtSource& source,
          const NdtConfig& config)
      : map_(map), coarser_(coarser), source_(source), config_(config) {
    config_.hessian = NdtConfig::Hessian::kGaussNewton;  // the curvature has to be positive
  }
  [[nodiscard]] PoseCost at(const Pose& target_from_source) const override {
    const MatchSums sums = ndt_cost(map_, source_, target_from_source, config_, 1.0, coarser_);
    const double share = config_.independent_share;
    return {share * sums.cost, share * sums.gradient, share * sums.hessian};
  }
  [[nodiscard]] double step_translation_m() const override { return config_.step_translation_m; }
  [[nodiscard]] double step_rotation_rad() const override { return config_.step_rotation_rad; }

 private:
  const NdtMap& map_;
  const NdtMap* coarser_;
  NdtSource source_;
  NdtConfig config_;
};

class NdtTarget : public MatchTarget {
 public:
  // `coarser`: see register_ndt.
  NdtTarget(std::vector<NdtMapPtr> maps, NdtMapPtr coarser, const NdtConfig& config)
      : maps_(std::move(maps)), coarser_(std::move(coarser)), config_(config) {}

  [[nodiscard]] RegistrationResult match(const Points& source, const Pose& guess,
                                         const PoseTerms& terms, MatchStart start) const override {
    return match_source(source, guess, terms, start);
  }
  [[nodiscard]] RegistrationResult match_features(const FeaturePoints& source, const Pose& guess,
                                                  const PoseTerms& terms,
                                                  MatchStart start) const override {
    return match_source({source.points, source.lidars}, guess, terms, start);
  }
  [[nodiscard]] double reach_m() const override { return maps_.back()->cell_size(); }
  [[nodiscard]] std::size_t size() const override { return maps_.back()->size(); }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost(const Points& source,
                                                      MatchStart start) const override {
    return cost_of(source, start);
  }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost_of_features(const FeaturePoints& source,
                                                                  MatchStart start) const override {
    return cost_of({source.points, source.lidars}, start);
  }

 private:
  [[nodiscard]] RegistrationResult match_source(const NdtSource& source, const Pose& guess,
                                                const PoseTerms& terms, MatchStart start) const {
    const std::span<const NdtMapPtr> maps(maps_);
    return register_ndt(start == MatchStart::kFar ? maps : maps.last(1), source, guess, terms,
                        config_, coarser_.get());
  }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost_of(const NdtSource& source,
                                                         MatchStart start) const {
    const bool far = start == MatchStart::kFar;
    return std::make_unique<NdtCost>(far ? *maps_.front() : *maps_.back(),
                                     far ? nullptr : coarser_.get(), source, config_);
  }

  std::vector<NdtMapPtr> maps_;
  NdtMapPtr coarser_;
  NdtConfig config_;
};

// The maps of a target: coarse to fine, then that for sparse places, unless it is one of them.
std::vector<double> sizes_of_maps(const NdtMatcherConfig& config) {
  std::vector<double> sizes = config.cell_sizes_m;
  if (config.sparse_cell_m > 0.0 &&
      std::find(sizes.begin(), sizes.end(), config.sparse_cell_m) == sizes.end()) {
    sizes.push_back(config.sparse_cell_m);
  }
  return sizes;
}

MatchTargetPtr target_of(std::vector<NdtMapPtr> maps, const NdtMatcherConfig& config) {
  NdtMapPtr coarser;
  for (const NdtMapPtr& map : maps) {
    if (map->cell_size() == config.sparse_cell_m) coarser = map;
  }
  maps.resize(config.cell_sizes_m.size());
  return std::make_shared<NdtTarget>(std::move(maps), std::move(coarser), config.steps);
}

class NdtTargetBuilder : public TargetBuilder {
 public:
  NdtTargetBuilder(const NdtMatcherConfig& config, const Viewpoint& viewpoint) : config_(config) {
    for (const double size : sizes_of_maps(config)) {
      NdtMapConfig cells = config.cells;
      cells.cell_size_m = size;
      cells.viewpoint_in_source = viewpoint.lidar_in_source;
      cells.further_viewpoints_in_source = viewpoint.further_lidars_in_source;
      builders_.emplace_back(cells);
    }
  }

  void insert(const Points& points_in_source, const Pose& target_from_source,
              std::optional<double> forget_beyond_m) override {
    insert_source(points_in_source, target_from_source, forget_beyond_m);
  }
  void insert_features(const FeaturePoints& points_in_source, const Pose& target_from_source,
                       std::optional<double> forget_beyond_m) override {
    insert_source({points_in_source.points, points_in_source.lidars}, target_from_source,
                  forget_beyond_m);
  }
  void insert_source(const NdtSource& source, const Pose& target_from_source,
                     std::optional<double> forget_beyond_m) {
    const Points part_points = thin_evenly(source.points, kEnoughForCoarse, kCoarseEvery);
    const std::vector<std::uint8_t> part_lidars =
        thin_evenly(source.lidars, kEnoughForCoarse, kCoarseEvery);
    const NdtSource part(part_points, part_lidars);
    const double finest = config_.cell_sizes_m.back();
    parallel_for(builders_.size(), 1, [&](std::size_t i) {
      NdtMapBuilder& builder = builders_[i];
      // That for sparse places has all points, too.
      const bool coarse =
          i < config_.cell_sizes_m.size() && config_.cell_sizes_m[i] >= 2.0 * finest;
      builder.insert(coarse ? part : source, target_from_source);
      if (forget_beyond_m)
        builder.remove_beyond(target_from_source.translation(), *forget_beyond_m);
    });
  }

  void forget_beyond(const Eigen::Vector3d& centre, double radius_m) override {
    for (NdtMapBuilder& builder : builders_)
      builder.remove_beyond(centre, radius_m);
  }
  void clear() override {
    for (NdtMapBuilder& builder : builders_)
      builder.clear();
  }
  [[nodiscard]] double bytes() const override {
    double sum = 0.0;
    for (const NdtMapBuilder& builder : builders_)
      sum += builder.bytes();
    return sum;
  }

  [[nodiscard]] MatchTargetPtr snapshot() override {
    std::vector<NdtMapPtr> maps(builders_.size());
    parallel_for(builders_.size(), 1, [&](std::size_t i) { maps[i] = builders_[i].snapshot(); });
    return target_of(std::move(maps), config_);
  }

 private:
  NdtMatcherConfig config_;
  std::vector<NdtMapBuilder> builders_;
};

class NdtMatcher : public Matcher {
 public:
  explicit NdtMatcher(const NdtMatcherConfig& config) : config_(config) {
    if (config.cell_sizes_m.empty()) throw ConfigError({"ndt.cell_sizes_m: is empty"});
    for (const double size : config.cell_sizes_m) {
      if (!(size >= 0.05 && size <= 20.0))
        throw ConfigError({"ndt.cell_sizes_m: expected values within 0.05..20 m"});
    }
    if (config.sparse_cell_m != 0.0 && !(config.sparse_cell_m > config.cell_sizes_m.back()))
      throw ConfigError({"ndt.sparse_cell_m: expected 0 or more than the finest cell"});
  }

  [[nodiscard]] std::unique_ptr<TargetBuilder> make_builder(
      const Viewpoint& viewpoint) const override {
    return std::make_unique<NdtTargetBuilder>(config_, viewpoint);
  }
  // One cloud is not so much that its coarse cells had to do with a part of it.
  [[nodiscard]] MatchTargetPtr make_target(const Points& points) const override {
    const PlacedCloud cloud{&points, Pose()};
    std::vector<NdtMapPtr> maps;
    for (const double size : sizes_of_maps(config_)) {
      NdtMapConfig cells = config_.cells;
      cells.cell_size_m = size;
      maps.push_back(build_ndt_map(std::span(&cloud, 1), cells));
    }
    return target_of(std::move(maps), config_);
  }
  [[nodiscard]] double reach_m() const override { return config_.cell_sizes_m.back(); }
  [[nodiscard]] bool sums_up_points() const override { return true; }

 private:
  NdtMatcherConfig config_;
};

void describe_cells(ConfigTable& table, NdtMapConfig& cells) {
  table.add("min_points", cells.min_points, {3, 1000}, "",
            "fewest points of a cell that has a distribution");
  table.add("growth", cells.growth, {0.0, 1.0}, "",
            "share of new points at which a cell's distribution is computed again");
  table.add("sigma_floor_m", cells.sigma_floor_m, {1e-3, 1.0}, "m",
            "least thickness of a surface (standard deviation)");
  table.add("second_axis_weight", cells.second_axis_weight, {0.0, 1.0}, "",
            "weight of a cell's second thinnest direction");
  table.add("volume_weight", cells.volume_weight, {0.0, 1.0}, "",
            "weight of cells that are neither surface nor line");
  table.add("near_side_line", cells.near_side_line, {0.0, 2.0}, "",
            "the visible side of a stem lies before the middle of its cell by this share of the "
            "spread; 0: in its middle");
  table.add("near_side_volume", cells.near_side_volume, {0.0, 2.0}, "",
            "the same of cells that are neither surface nor line");
  table.add("few_rings", cells.few_rings,
            "a surface seen exactly edge-on is the trace of one ring; of sparse scans true");
}

}  // namespace

void describe(ConfigTable& table, NdtMatcherConfig& config) {
  table.add("cell_sizes_m", config.cell_sizes_m, "m", "cells of the maps, coarse to fine");
  table.add("sparse_cell_m", config.sparse_cell_m, {0.0, 20.0}, "m",
            "cells for points whose finest cell has too few points; 0: such points match nothing; "
            "of sparse scans twice the finest");
  describe_cells(table, config.cells);
  describe(table, config.steps);
}

std::unique_ptr<const Matcher> make_matcher(const NdtMatcherConfig& config) {
  return std::make_unique<NdtMatcher>(config);
}

// Sparse scans leave few surfaces, so all cells of the map count. Guesses of scans alone are off by
// more than the finest cells bridge, and the coarsest are too coarse to lead to them. A map in
// between helps.
std::vector<SuitedSetting> suited_settings(const NdtMatcherConfig& config,
                                           const ScanTraits& traits) {
  std::vector<SuitedSetting> suited;
  if (traits.sparse) {
    if (config.cells.min_points > kSparseMinPoints)
      suited.push_back({"min_points", fmt::format("{}", kSparseMinPoints)});
    if (config.cells.volume_weight < kSparseVolumeWeight)
      suited.push_back({"volume_weight", fmt::format("{}", kSparseVolumeWeight)});
    suited.push_back({"few_rings", "true"});
    if (config.sparse_cell_m == 0.0)
      suited.push_back({"sparse_cell_m", fmt::format("{}", 2.0 * config.cell_sizes_m.back())});
  }
  const std::vector<double>& cells = config.cell_sizes_m;
  if (traits.alone && cells.size() == 2) {
    suited.push_back({"cell_sizes_m", fmt::format("[{}, {}, {}]", cells[0],
                                                  std::sqrt(cells[0] * cells[1]), cells[1])});
  }
  return suited;
}

}  // namespace understory
