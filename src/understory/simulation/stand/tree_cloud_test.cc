#include "understory/simulation/stand/tree_cloud.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"
#include "understory/simulation/stand/tree_cloud.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

// An oval stem (30 x 24 cm at the foot, tapering to 8 m) away from zero and leaning, with a ball of
// foliage at 5 to 8 m. No grown stem has such a shape.
std::string write_oval_tree(const std::string& name) {
  Random random(3);
  std::ofstream file(name);
  std::string body;
  int count = 0;
  const auto add = [&](double x, double y, double z) {
    body += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
    ++count;
  };
  for (double z = 0.0; z < 7.5; z += 0.012) {
    const double thin = 1.0 - z / 8.0;
    for (double angle = 0.0; angle < kTau; angle += 0.09) {
      add(5.0 + 0.03 * z + 0.15 * thin * std::cos(angle), -2.0 + 0.12 * thin * std::sin(angle),
          200.0 + z);
    }
  }
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d place(random.normal(), random.normal(), random.normal());
    const Eigen::Vector3d out = 0.9 * place.normalized();
    add(5.2 + out.x(), -2.0 + out.y(), 206.6 + 1.4 * out.z() / 0.9);
  }
  file << "ply\nformat ascii 1.0\nelement vertex " << count
       << "\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
       << body;
  return name;
}

class CloudTrees : public ::testing::Test {
 protected:
  void SetUp() override { write_oval_tree(folder_ + "/oval.ply"); }
  const test::TemporaryFolder own_;
  const std::string folder_ = own_.path();
};

TEST_F(CloudTrees, StemIsFollowedAndDiscsLieInItsSurface) {
  const TreeCloud tree = read_tree_cloud(folder_ + "/oval.ply", 0.24);
  EXPECT_NEAR(tree.height_m, 8.0, 0.05);
  EXPECT_NEAR(tree.lean.x(), 0.03, 0.004);
  EXPECT_NEAR(tree.lean.y(), 0.0, 0.004);
  EXPECT_GT(tree.stem.size(), 15'000U);
  int askew = 0;
  for (const TreeCloud::Disc& disc : tree.stem) {
    const double thin = 1.0 - disc.centre.z() / 8.0;
    const Eigen::Vector2d off(disc.centre.x() - 0.03 * disc.centre.z(), disc.centre.y());
    EXPECT_LT(off.norm(), 0.15 * thin + 0.08);
    const Eigen::Vector2d normal(off.x() / (0.15 * 0.15), off.y() / (0.12 * 0.12));
    const double along = std::abs(normal.normalized().dot(disc.normal.head<2>().cast<double>()));
    askew += along < 0.95 ? 1 : 0;
  }
  EXPECT_LT(askew, 0.03 * static_cast<double>(tree.stem.size()));
  // The ball counts as foliage, all but what the stem runs through.
  EXPECT_GT(tree.crown.size(), 2'500U);
}

TEST_F(CloudTrees, StandInTheStandAndAreScannedInTheirOwnShape) {
  const std::string list = folder_ + "/trees.csv";
  std::ofstream(list) << "id,x,y,dbh_m,height_m,cloud\n41,2.0,0,0.24,,oval.ply\n"
                         "42,-6,0,0.36,12,oval.ply\n43,0,9,0.2,15,\n";
  const TerrainConfig flat{.relief_m = 0.0, .slope_deg = 0.0, .hummock_m = 0.0, .roughness_m = 0.0};
  const Terrain terrain(flat, 20.0, 20.0, 1);
  StandConfig config;
  config.trees = list;
  config.wind_sway_m = 0.0;
  Stand stand;
  stand.trees = read_trees(list, config, terrain, 1);
  ASSERT_EQ(stand.trees.size(), 3U);
  EXPECT_NEAR(stand.trees[0].height_m, 8.0, 0.05);
  EXPECT_NEAR(stand.trees[1].height_m, 12.0, 1e-9);
  EXPECT_NEAR(stand.trees[0].lean_deg(), std::atan(0.03) * 360.0 / kTau, 0.3);
  stand.trees[0].yaw_rad = stand.trees[1].yaw_rad = 0.0;
  const ForestScene scene(config, terrain, stand, 1);
  // Level looks from all sides at a height: both diameters of the oval, stretched for the second.
  for (const int i : {0, 1}) {
    const double stretch = i == 0 ? 1.0 : 12.0 / stand.trees[0].height_m;
    const double height = 1.0 * stretch;
    const double thin = 1.0 - 1.0 / 8.0;
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(0.0, -1.0)}) {
      const double radius = stretch * thin * (side.x() != 0.0 ? 0.15 : 0.12);
      const Eigen::Vector3d middle = stand.trees[static_cast<std::size_t>(i)].foot +
                                     Eigen::Vector3d(0.03 * height, 0.0, height);
      const Eigen::Vector3d from = middle + Eigen::Vector3d(side.x(), side.y(), 0.0);
      const Ray ray{from.cast<float>(), Eigen::Vector3f(static_cast<float>(-side.x()),
                                                        static_cast<float>(-side.y()), 0.0F)};
      Hit hit;
      scene.cast(&ray, 1, 0.05F, 3.0F, &hit);
      EXPECT_EQ(hit.tree, 41 + i);
      EXPECT_EQ(hit.surface, Surface::kStem);
      EXPECT_NEAR(hit.range_m, 1.0 - radius, 0.006 * stretch);
      EXPECT_GT(hit.cosine, 0.9);
    }
  }
}

// The cache of scans once went on with what was cast of the former cloud.
TEST_F(CloudTrees, AnotherCloudOfTheSameNameMakesAnotherKey) {
  std::ofstream(folder_ + "/trees.csv") << "x,y,dbh_m,cloud\n2,0,0.24,oval.ply\n";
  SiteConfig site;
  site.stand.trees = folder_ + "/trees.csv";
  const std::uint64_t key = site_key(site);
  EXPECT_EQ(site_key(site), key);
  EXPECT_EQ(tree_cloud_files(site.stand.trees),
            std::vector<std::string>{(std::filesystem::path(folder_) / "oval.ply").string()});
  std::ofstream(folder_ + "/oval.ply", std::ios::app) << "5 -2 203\n";
  EXPECT_NE(site_key(site), key);
}

// Each disc's neighbours are the nearest there are: against a search through all points.
TEST_F(CloudTrees, DiscsReachToTheFourthNearestPoint) {
  const TreeCloud tree = read_tree_cloud(folder_ + "/oval.ply", 0.24);
  std::vector<TreeCloud::Disc> all = tree.stem;
  all.insert(all.end(), tree.crown.begin(), tree.crown.end());
  for (std::size_t i = 0; i < all.size(); i += 997) {
    std::vector<float> distances;
    for (const TreeCloud::Disc& other : all)
      distances.push_back((other.centre - all[i].centre).norm());
    std::partial_sort(distances.begin(), distances.begin() + 5, distances.end());
    EXPECT_NEAR(all[i].radius_m, std::clamp(distances[4], 0.004F, 0.03F), 1e-5F);
    EXPECT_GT(distances[1], 0.0069F);  // thinned
  }
}

TEST_F(CloudTrees, InstancesShareTheirCloud) {
  const std::string list = folder_ + "/many.csv";
  std::ofstream file(list);
  file << "x,y,dbh_m,cloud\n";
  for (int i = 0; i < 2000; ++i)
    file << (i % 50) - 25 << "," << i / 50 - 20 << ",0.24,oval.ply\n";
  file.close();
  const Terrain terrain({}, 40.0, 40.0, 1);
  StandConfig config;
  config.trees = list;
  const double before = resident_memory_mb();
  Stand stand;
  stand.trees = read_trees(list, config, terrain, 1);
  const ForestScene scene(config, terrain, stand, 1);
  // 120 MB, and 440 under a sanitizer; 2,000 clouds of their own would take 10 GB.
  EXPECT_LT(resident_memory_mb() - before, 1000.0);
}

TEST_F(CloudTrees, BadOnesAreRefused) {
  EXPECT_THROW((void)read_tree_cloud(folder_ + "/none.laz", 0.2), InputError);
  std::ofstream(folder_ + "/few.ply") << "ply\nformat ascii 1.0\nelement vertex 2\nproperty float "
                                         "x\nproperty float y\nproperty float z\nend_header\n"
                                         "0 0 0\n0 0 9\n";
  EXPECT_THROW((void)read_tree_cloud(folder_ + "/few.ply", 0.2), InputError);
}

TEST(RealTree, OfTheExampleDataStands) {
  const char* given = std::getenv("UNDERSTORY_DATA");
  const std::filesystem::path data =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(UNDERSTORY_SOURCE_DIR) / "../shared/data";
  const auto path = data / "treels" / "pine.laz";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no data";
  const TreeCloud tree = read_tree_cloud(path.string(), 0.2);
  EXPECT_NEAR(tree.height_m, 20.16, 0.01);
  EXPECT_GT(tree.stem.size(), 2'000U);
  EXPECT_GT(tree.crown.size(), 10'000U);
  // Its stem is round and of a tree's size: discs of one slice lie on a circle.
  std::vector<double> radii;
  Eigen::Vector2f low(9.0F, 9.0F);
  Eigen::Vector2f high(-9.0F, -9.0F);
  for (const TreeCloud::Disc& disc : tree.stem) {
    if (std::abs(disc.centre.z() - 1.3F) > 0.1F) continue;
    low = low.cwiseMin(disc.centre.head<2>());
    high = high.cwiseMax(disc.centre.head<2>());
  }
  const Eigen::Vector2f width = high - low;
  EXPECT_GT(width.minCoeff(), 0.12F);
  EXPECT_LT(width.maxCoeff(), 0.45F);
}

}  // namespace
}  // namespace understory
