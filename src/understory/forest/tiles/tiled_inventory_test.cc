#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/forest/test_plot.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Points of a cloud sorted into squares; they come by tile, and backwards within a tile.
class SortedCloud : public TiledCloud {
 public:
  SortedCloud(const Cloud& cloud, double tile_m, bool backwards, bool side_by_side)
      : side_by_side_(side_by_side), scratch_(std::filesystem::temp_directory_path()) {
    level_ = std::floor(cloud.front().z());
    const auto number = [&](double value) { return static_cast<int>(std::floor(value / tile_m)); };
    for (int row = -1; row < 8; ++row) {
      for (int column = -1; column < 8; ++column) {
        std::vector<Eigen::Vector3d> points;
        for (const Eigen::Vector3d& point : cloud) {
          if (number(point.x()) == column && number(point.y()) == row) points.push_back(point);
        }
        if (points.empty()) continue;
        if (backwards) std::reverse(points.begin(), points.end());
        const Eigen::Vector2d low(column * tile_m, row * tile_m);
        tiles_.push_back({low, {(column + 1) * tile_m, (row + 1) * tile_m}});
        points_.push_back(std::move(points));
      }
    }
    if (!backwards) return;
    std::reverse(tiles_.begin(), tiles_.end());
    std::reverse(points_.begin(), points_.end());
  }

  [[nodiscard]] const std::vector<GroundArea>& tiles() const override { return tiles_; }
  [[nodiscard]] bool side_by_side() const override { return side_by_side_; }
  void all(const PointVisitor& visit) const override {
    for (const auto& points : points_)
      visit(points);
  }
  void in(const GroundArea& area, const PointVisitor& visit) const override {
    for (const std::size_t tile : tiles_touching(*this, area))
      visit(points_[tile]);
  }
  [[nodiscard]] std::optional<double> level() const override { return level_; }
  [[nodiscard]] ScratchFile* scratch() const override { return &scratch_; }

 private:
  bool side_by_side_;
  double level_ = 0.0;
  mutable ScratchFile scratch_;
  std::vector<GroundArea> tiles_;
  std::vector<std::vector<Eigen::Vector3d>> points_;
};

// Lying stems across borders of tiles, and stumps on them.
void add_dead_wood(TestPlot& plot, Random& random) {
  for (const double middle : {20.3, 25.0, 49.0, 76.0}) {
    for (int i = 0; i < 3'000; ++i) {
      const double along = random.uniform(-4.0, 4.0);
      const double turn = random.uniform(-0.1 * M_PI, 1.1 * M_PI);
      const double r = 0.15 + random.normal(0.0, 0.006);
      const double x = middle + along;
      const double y = 15.5 + 0.1 * along + r * std::cos(turn);
      plot.cloud.emplace_back(x, y, plot.ground(x, 15.5) + 0.12 + r * std::sin(turn));
    }
    for (int i = 0; i < 500; ++i) {
      const double turn = random.uniform(0.0, 2.0 * M_PI);
      const double r = 0.14 + random.normal(0.0, 0.006);
      const double y = 14.3;
      plot.cloud.emplace_back(middle + r * std::cos(turn), y + r * std::sin(turn),
                              plot.ground(middle, y) + random.uniform(0.0, 0.45));
    }
  }
}

// A strip of 100 m by 12 m on a slope, longer than a tile and its surroundings. Stems stand at the
// borders of 20 and 25 m and elsewhere, with a hedge and undergrowth.
const Cloud& strip_of_stems() {
  static const Cloud cloud = [] {
    TestPlot plot(11);
    plot.slope_x = 0.1;
    plot.bump_m = 0.5;
    Random random(12);
    for (int i = 0; i < 20'000; ++i) {
      const double x = random.uniform(0.0, 100.0);
      const double y = random.uniform(14.0, 26.0);
      plot.cloud.emplace_back(x, y, plot.ground(x, y) + random.normal(0.0, 0.02));
    }
    for (int i = 0; i < 26; ++i) {
      TestPlot::Stem stem{2.0 + 3.8 * i + random.uniform(-1.0, 1.0), random.uniform(15.0, 25.0),
                          random.uniform(0.06, 0.4)};
      if (i % 5 == 1) stem.y = 20.0;  // on a border
      if (i == 13) stem.x = 50.0;
      stem.lean_x = random.uniform(-0.1, 0.1);
      plot.add_stem(stem);
    }
    // Stems whose feet are hidden, on borders of tiles.
    for (const double x : {25.0, 50.1, 60.9}) {
      const double y = 20.0 - 4.0 * std::sin(0.2 * x);
      for (int i = 0; i < 900; ++i) {
        const double turn = random.uniform(0.0, M_PI);
        const double r = 0.14 + random.normal(0.0, 0.006);
        plot.cloud.emplace_back(x + r * std::cos(turn), y + r * std::sin(turn),
                                plot.ground(x, y) + random.uniform(2.8, 6.0));
      }
    }
    // Young trees, on borders of tiles and beside them.
    for (const double x : {19.9, 25.1, 40.6, 49.95, 75.0})
      plot.add_young_tree(x, 17.0 + std::sin(x), 0.035, 3.2);
    add_dead_wood(plot, random);
    for (int i = 0; i < 24'000; ++i) {
      const double x = random.uniform(0.0, 100.0);
      const double y = 20.0 + 4.0 * std::sin(0.2 * x) + random.normal(0.0, 0.04);
      plot.cloud.emplace_back(x, y, plot.ground(x, y) + random.uniform(0.3, 2.0));
    }
    for (int i = 0; i < 3'000; ++i) {
      const double x = random.uniform(0.0, 100.0);
      const double y = random.uniform(14.0, 26.0);
      plot.cloud.emplace_back(x, y, plot.ground(x, y) + random.uniform(0.3, 4.0));
    }
    return plot.cloud;
  }();
  return cloud;
}

void expect_same(double a, double b) {
  EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << a << " " << b;
}

void expect_same(const Raster& a, const Raster& b) {
  ASSERT_EQ(a.columns, b.columns);
  ASSERT_EQ(a.rows, b.rows);
  for (std::size_t i = 0; i < a.values.size(); ++i)
    expect_same(static_cast<double>(a.values[i]), static_cast<double>(b.values[i]));
}

void expect_same(const std::vector<DeadWood>& a, const std::vector<DeadWood>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].kind, b[i].kind);
    EXPECT_EQ(a[i].from, b[i].from);
    EXPECT_EQ(a[i].to, b[i].to);
    EXPECT_EQ(a[i].diameter_m, b[i].diameter_m);
    EXPECT_EQ(a[i].diameter_sd_m, b[i].diameter_sd_m);
    EXPECT_EQ(a[i].observations, b[i].observations);
  }
}

void expect_same(const InventoryResult& a, const InventoryResult& b) {
  ASSERT_EQ(a.dead_wood.has_value(), b.dead_wood.has_value());
  if (a.dead_wood) expect_same(*a.dead_wood, *b.dead_wood);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.area_m2, b.area_m2);
  EXPECT_EQ(a.remarks, b.remarks);
  EXPECT_EQ(a.blur_m, b.blur_m);
  EXPECT_EQ(a.range_noise_m, b.range_noise_m);
  expect_same(a.ground.terrain, b.ground.terrain);
  expect_same(a.canopy, b.canopy);
  ASSERT_EQ(a.trees.size(), b.trees.size());
  for (std::size_t i = 0; i < a.trees.size(); ++i) {
    const Tree& one = a.trees[i];
    const Tree& other = b.trees[i];
    for (const auto member :
         {&Tree::x, &Tree::y, &Tree::z, &Tree::dbh_m, &Tree::dbh_sd_m, &Tree::height_m,
          &Tree::lean_deg, &Tree::x_sd_m, &Tree::y_sd_m, &Tree::stem_volume_m3,
          &Tree::stem_volume_sd_m3, &Tree::crown_base_m, &Tree::crown_area_m2,
          &Tree::crown_volume_m3, &Tree::fork_m, &Tree::sweep_m})
      expect_same(one.*member, other.*member);
    EXPECT_EQ(one.observations, other.observations);
    EXPECT_EQ(one.id, other.id);
  }
  EXPECT_EQ(a.crown_outlines, b.crown_outlines);
  EXPECT_EQ(a.two_images, b.two_images);
  ASSERT_EQ(a.stems.size(), b.stems.size());
  for (std::size_t i = 0; i < a.stems.size(); ++i) {
    expect_same(a.stems[i].oval.x(), b.stems[i].oval.x());
    expect_same(a.stems[i].oval.y(), b.stems[i].oval.y());
  }
}

// The tree of each point, in the order of the cloud.
std::vector<std::uint32_t> labels_of(const InventoryResult& result, const TiledCloud* tiled) {
  std::vector<std::uint32_t> labels(strip_of_stems().size(), 0);
  const auto label = [&](const TreeOwners& owners, std::size_t i) {
    const Eigen::Vector3d& point = strip_of_stems()[i];
    labels[i] = tree_at(result, owners, point, result.ground.height_above(point));
  };
  const std::size_t tiles = tiled == nullptr ? 1 : tiled->tiles().size();
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    const TreeOwners owners =
        result.owner_tiles ? result.owner_tiles->owners(tile) : *result.owners;
    for (std::size_t i = 0; i < labels.size(); ++i) {
      if (!result.owner_tiles || result.owner_tiles->holds(tile, strip_of_stems()[i]))
        label(owners, i);
    }
  }
  return labels;
}

TEST(TiledInventory, TheSameTreesWhateverTheTilesAre) {
  const InventoryResult whole = take_inventory(blocks_of(strip_of_stems()), {});
  EXPECT_GE(whole.trees.size(), 25U);
  const auto hidden = std::count_if(whole.stems.begin(), whole.stems.end(),
                                    [](const StemFit& stem) { return stem.below_sd_m > 0.0; });
  EXPECT_GE(hidden, 3);
  const auto young = std::count_if(whole.stems.begin(), whole.stems.end(),
                                   [](const StemFit& stem) { return stem.in_foliage; });
  EXPECT_GE(young, 3);
  const auto logs =
      std::count_if(whole.dead_wood->begin(), whole.dead_wood->end(),
                    [](const DeadWood& piece) { return piece.kind == DeadWoodKind::kLog; });
  EXPECT_GE(logs, 3);
  EXPECT_GE(static_cast<std::ptrdiff_t>(whole.dead_wood->size()) - logs, 3);
  const std::vector<std::uint32_t> labels = labels_of(whole, nullptr);
  bool backwards = false;
  for (const double tile_m : {128.0, 50.0, 25.0, 20.3}) {
    SCOPED_TRACE(::testing::Message() << tile_m);
    const SortedCloud tiles(strip_of_stems(), tile_m, backwards, backwards);
    const InventoryResult tiled = take_inventory(tiles, {});
    expect_same(whole, tiled);
    EXPECT_EQ(labels, labels_of(tiled, &tiles));
    backwards = !backwards;
  }
}

TEST(TiledInventory, ABlurredCloudHasTheSameTreesWhateverTheTilesAre) {
  Random random(13);
  Cloud cloud = strip_of_stems();
  for (Eigen::Vector3d& point : cloud)
    point += 0.04 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  const InventoryResult whole = take_inventory(blocks_of(cloud), basic_inventory());
  EXPECT_NEAR(whole.blur_m, 0.04, 0.005);
  EXPECT_GE(whole.trees.size(), 20U);
  for (const double tile_m : {50.0, 20.3}) {
    SCOPED_TRACE(::testing::Message() << tile_m);
    expect_same(whole, take_inventory(SortedCloud(cloud, tile_m, false, false), basic_inventory()));
  }
}

// Stems of 20 to 34 cm that a lidar with noisy ranges saw from two sides each.
Cloud strip_in_noise(double noise_m) {
  TestPlot plot(17);
  Random random(18);
  plot.add_ground(40.0, 40);
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector2d at(3.0 + 4.7 * k, 8.0 + 6.0 * (k % 3));
    const double radius = 0.1 + 0.01 * k;
    for (int i = 0; i < 3'000; ++i) {
      const double turn = i % 2 == 0 ? 0.3 : 1.2;
      const Eigen::Vector2d view(std::cos(turn), std::sin(turn));
      const Eigen::Vector2d across(-view.y(), view.x());
      const double height = random.uniform(0.1, 4.0);
      const double r = radius - 0.008 * (height - 1.3);
      const double off = random.uniform(-r, r);
      const double depth = -std::sqrt(r * r - off * off) + random.normal(0.0, noise_m);
      const Eigen::Vector2d point = at + (off + random.normal(0.0, 0.008)) * across + depth * view;
      plot.cloud.emplace_back(point.x(), point.y(), plot.ground(at.x(), at.y()) + height);
    }
  }
  return plot.cloud;
}

TEST(TiledInventory, NoiseAlongTheBeamsIsFoundWhateverTheTilesAre) {
  const Cloud cloud = strip_in_noise(0.03);
  const InventoryResult whole = take_inventory(blocks_of(cloud), basic_inventory());
  EXPECT_NEAR(whole.range_noise_m, 0.03, 0.005);
  ASSERT_EQ(whole.trees.size(), 8U);
  for (std::size_t k = 0; k < 8; ++k)
    EXPECT_NEAR(whole.trees[k].dbh_m, 0.2 + 0.02 * static_cast<double>(k), 0.015) << k;
  for (const double tile_m : {25.0, 20.3}) {
    SCOPED_TRACE(::testing::Message() << tile_m);
    const InventoryResult tiled =
        take_inventory(SortedCloud(cloud, tile_m, false, false), basic_inventory());
    EXPECT_EQ(tiled.range_noise_m, whole.range_noise_m);
    expect_same(whole, tiled);
  }
}

TEST(TiledInventory, AFullOneHasTheTreesOfABasicOneAndThinnerOnes) {
  const InventoryResult full = take_inventory(blocks_of(strip_of_stems()), {});
  const InventoryResult basic = take_inventory(blocks_of(strip_of_stems()), basic_inventory());
  std::vector<Tree> thick;
  std::copy_if(full.trees.begin(), full.trees.end(), std::back_inserter(thick),
               [](const Tree& tree) { return tree.dbh_m >= 0.05; });
  EXPECT_LT(thick.size(), full.trees.size());
  ASSERT_EQ(thick.size(), basic.trees.size());
  for (std::size_t i = 0; i < thick.size(); ++i) {
    EXPECT_EQ(thick[i].x, basic.trees[i].x);
    EXPECT_EQ(thick[i].y, basic.trees[i].y);
    EXPECT_EQ(thick[i].dbh_m, basic.trees[i].dbh_m);
  }
}

TEST(TiledInventory, TheSameBytesForAnyNumberOfThreads) {
  const SortedCloud tiles(strip_of_stems(), 50.0, false, true);
  InventoryResult one;
  InventoryResult three;
  with_threads(1, [&] { one = take_inventory(tiles, {}); });
  with_threads(3, [&] { three = take_inventory(tiles, {}); });
  expect_same(one, three);
}

}  // namespace
}  // namespace understory
