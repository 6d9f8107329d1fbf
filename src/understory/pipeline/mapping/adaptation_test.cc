#include "understory/pipeline/mapping/adaptation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/sparse/sparse_mapping_config.h"
#include "understory/pipeline/profiles.h"
#include "understory/util/log.h"

namespace understory {
namespace {

SensorTraits sixteen_rings() {
  SensorTraits traits;
  traits.scan_points = 29'000;
  traits.rings = 16;
  traits.has_imu = true;
  return traits;
}

SensorTraits many_rings() {
  SensorTraits traits;
  traits.scan_points = 110'000;
  traits.rings = 128;
  traits.has_imu = true;
  return traits;
}

std::vector<std::string> keys_of(const std::vector<ConfigAdaptation>& changes) {
  std::vector<std::string> keys;
  for (const ConfigAdaptation& change : changes)
    keys.push_back(change.key);
  std::sort(keys.begin(), keys.end());
  return keys;
}

Adapted<DenseMappingConfig> adapt_read(const std::string& profile,
                                       const std::vector<std::string>& settings,
                                       const SensorTraits& traits,
                                       const RunConditions& conditions = {}) {
  const ReadConfig<DenseMappingConfig> read = read_dense_mapping_config(profile, "", settings);
  return adapt(read.config, read.origins, traits, conditions);
}

const NdtMatcherConfig& ndt_of(const Adapted<DenseMappingConfig>& adapted) {
  return adapted.config.keyframe_map.local_map.matcher.get<NdtMatcherConfig>();
}

std::string yaml_of(DenseMappingConfig config) {
  return dense_mapping_table(config).to_yaml(false);
}

TEST(Adaptation, ADenseLidarWithAnImuRunsAsAsked) {
  const auto adapted = adapt_read("", {}, many_rings());
  EXPECT_TRUE(adapted.changes.empty());
  EXPECT_EQ(yaml_of(adapted.config), yaml_of(DenseMappingConfig()));
}

TEST(Adaptation, AFullInventoryKeepsFarPointsOfMoreScans) {
  const auto adapted = adapt_read("", {"inventory.extent=full"}, many_rings());
  EXPECT_EQ(keys_of(adapted.changes), std::vector<std::string>{"map.far_cloud_distance_m"});
  EXPECT_EQ(adapted.config.far_cloud_distance_m, 0.25);
  const auto asked =
      adapt_read("", {"inventory.extent=full", "map.far_cloud_distance_m=0"}, many_rings());
  EXPECT_EQ(asked.config.far_cloud_distance_m, 0.0);
}

TEST(Adaptation, SparseScansAreThinnedLessAndEachChangeIsTold) {
  const auto adapted = adapt_read("", {}, sixteen_rings());
  EXPECT_EQ(adapted.config.odometry.voxel.voxel_size_m, 0.1);
  EXPECT_EQ(adapted.config.odometry.match.min_inlier_ratio, 0.05);
  EXPECT_EQ(adapted.config.keyframe_map.keyframe.distance_m, 0.3);
  EXPECT_EQ(ndt_of(adapted).cells.min_points, 4);
  EXPECT_EQ(ndt_of(adapted).cells.volume_weight, 1.0);
  EXPECT_TRUE(ndt_of(adapted).cells.few_rings);
  EXPECT_EQ(ndt_of(adapted).sparse_cell_m, 1.0);
  EXPECT_EQ(adapted.config.cloud_distance_m, 0.1);
  EXPECT_EQ(keys_of(adapted.changes),
            (std::vector<std::string>{
                "keyframe.below_found_share", "keyframe.distance_m", "map.cloud_distance_m",
                "preprocess.voxel.voxel_size_m", "registration.few_found_residual",
                "registration.min_inlier_ratio", "registration.ndt.few_rings",
                "registration.ndt.min_points", "registration.ndt.sparse_cell_m",
                "registration.ndt.volume_weight"}));
  // Nothing else changed than what is told.
  DenseMappingConfig back = adapted.config;
  const ConfigTable table = dense_mapping_table(back);
  for (const ConfigAdaptation& change : adapted.changes) {
    EXPECT_EQ(value_of(table, change.key), change.to);
    EXPECT_NE(change.why.find("29000 points"), std::string::npos) << change.why;
    set_value(table, change.key, change.from);
  }
  EXPECT_EQ(yaml_of(back), yaml_of(DenseMappingConfig()));
}

// What was set was replaced, also by a value that was the default's anyway.
TEST(Adaptation, WhatTheUserSetStays) {
  const auto adapted =
      adapt_read("",
                 {"preprocess.voxel.voxel_size_m=0.4", "registration.ndt.volume_weight=0.03",
                  "registration.ndt.cell_sizes_m=[2, 0.5]"},
                 [] {
                   SensorTraits alone = sixteen_rings();
                   alone.has_imu = false;
                   return alone;
                 }());
  EXPECT_EQ(adapted.config.odometry.voxel.voxel_size_m, 0.4);
  EXPECT_EQ(ndt_of(adapted).cells.volume_weight, 0.03);
  EXPECT_EQ(ndt_of(adapted).cell_sizes_m, (std::vector<double>{2.0, 0.5}));
  EXPECT_EQ(
      keys_of(adapted.changes),
      (std::vector<std::string>{"keyframe.below_found_share", "keyframe.distance_m",
                                "map.cloud_distance_m", "registration.few_found_residual",
                                "registration.min_inlier_ratio", "registration.ndt.few_rings",
                                "registration.ndt.min_points", "registration.ndt.sparse_cell_m"}));
}

TEST(Adaptation, WhatAProfileSetStays) {
  const ReadConfig<DenseMappingConfig> read = read_dense_mapping_config("paper", "", {});
  const auto adapted = adapt(read.config, read.origins, sixteen_rings(), {});
  for (const ConfigAdaptation& change : adapted.changes)
    EXPECT_EQ(read.origins.count(change.key), 0U) << change.key;
  EXPECT_EQ(adapted.config.keyframe_map.keyframe.distance_m, 0.2);
}

TEST(Adaptation, AFlightThinsSparseScansMore) {
  const ReadConfig<DenseMappingConfig> read = read_dense_mapping_config("uav", "", {});
  const auto sparse = adapt(read.config, read.origins, sixteen_rings(), {});
  EXPECT_EQ(sparse.config.odometry.voxel.voxel_size_m, 0.2);
  const auto dense = adapt(read.config, read.origins, many_rings(), {});
  EXPECT_EQ(dense.config.odometry.voxel.voxel_size_m, 0.4);
}

TEST(Adaptation, AnUnknownLidarAndAThresholdOfNothingChangeNothing) {
  SensorTraits unknown;
  unknown.has_imu = true;
  EXPECT_TRUE(adapt_read("", {}, unknown).changes.empty());
  EXPECT_TRUE(adapt_read("", {"run.sparse_scan_points=0"}, sixteen_rings()).changes.empty());
  EXPECT_FALSE(adapt_read("", {"run.sparse_scan_points=120000"}, many_rings()).changes.empty());
}

TEST(Adaptation, ScansAloneHaveAMapInBetween) {
  SensorTraits alone = many_rings();
  alone.has_imu = false;
  const std::vector<double> three = {2.0, 1.0, 0.5};
  RunConditions doubted;
  doubted.imu_doubted = true;
  doubted.imu_judged_s = 7.5;
  for (const auto& adapted :
       {adapt_read("", {}, alone), adapt_read("", {}, many_rings(), doubted)}) {
    EXPECT_EQ(ndt_of(adapted).cell_sizes_m, three);
    EXPECT_EQ(keys_of(adapted.changes),
              (std::vector<std::string>{"registration.ndt.cell_sizes_m"}));
  }
  EXPECT_EQ(adapt_read("", {}, many_rings(), doubted).changes.front().when_s, 7.5);
  EXPECT_EQ(ndt_of(adapt_read("", {"motion.imu_enabled=false"}, many_rings())).cell_sizes_m, three);
}

TEST(Adaptation, AnImuThatIsWrongIsLeftOutWhoeverAskedForIt) {
  RunConditions conditions;
  conditions.imu_refused = "its axes are swapped";
  conditions.imu_judged_s = 12.0;
  const auto adapted = adapt_read("", {"motion.imu_enabled=true"}, many_rings(), conditions);
  EXPECT_FALSE(adapted.config.odometry.imu_enabled);
  ASSERT_EQ(keys_of(adapted.changes),
            (std::vector<std::string>{"motion.imu_enabled", "registration.ndt.cell_sizes_m"}));
  EXPECT_EQ(adapted.changes.back().why, "its axes are swapped");
  EXPECT_EQ(adapted.changes.back().when_s, 12.0);
}

TEST(Adaptation, AtTheSpeedOfTheSensorsNothingWaitsUnlessTheUserSaysSo) {
  RunConditions live;
  live.realtime = true;
  const auto adapted = adapt_read("", {}, many_rings(), live);
  EXPECT_EQ(adapted.config.loop.time_repair.window_s, 0.0);
  EXPECT_EQ(keys_of(adapted.changes), (std::vector<std::string>{"time_repair.window_s"}));
  EXPECT_EQ(adapt_read("", {"time_repair.window_s=0.2"}, many_rings(), live)
                .config.loop.time_repair.window_s,
            0.2);
  const auto stems = adapt(SparseMappingConfig(), {{"stems.pace.longest_gap_s", "--set"}}, live);
  EXPECT_EQ(keys_of(stems.changes), (std::vector<std::string>{"time_repair.window_s"}));
  EXPECT_EQ(adapt(SparseMappingConfig(), {}, live).config.pace.longest_gap_s, 0.0);
}

TEST(Adaptation, PrintedWithWhatWasSetAndWhatWasChanged) {
  const ReadConfig<DenseMappingConfig> read =
      read_dense_mapping_config("", "", {"keyframe.distance_m=0.7"});
  const std::string text =
      commented_yaml(adapt(read.config, read.origins, sixteen_rings(), {}), read.origins);
  EXPECT_NE(text.find("    voxel_size_m: 0.1 "), std::string::npos) << text;
  EXPECT_NE(text.find(" # adapted from 0.4: 29000 points a scan of 16 rings, fewer than "),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("  distance_m: 0.7 "), std::string::npos) << text;
  EXPECT_NE(text.find(" # set by --set. distance after which a scan"), std::string::npos) << text;
}

// The value asked for stood there as the default.
TEST(Adaptation, DefaultsArePrintedAsTheyAre) {
  const ReadConfig<DenseMappingConfig> read =
      read_dense_mapping_config("", "", {"keyframe.distance_m=0.7"});
  const std::string text =
      commented_yaml(adapt(read.config, read.origins, sixteen_rings(), {}), read.origins);
  EXPECT_NE(text.find("see the next setting (default 0.5, m,"), std::string::npos) << text;
  EXPECT_NE(text.find("each gives one point (default 0.4, m,"), std::string::npos) << text;
}

TEST(Adaptation, ACheckpointGivesBackWhatItRestsOn) {
  BinaryWriter writer;
  RunConditions conditions{.realtime = true, .imu_refused = "wrong", .imu_judged_s = 3.5};
  put_origins(writer, {{"a.b", "profile x"}, {"c", "--set"}});
  put_traits(writer, sixteen_rings());
  put_conditions(writer, conditions);
  BinaryReader reader(writer.bytes(), "checkpoint");
  EXPECT_EQ(get_origins(reader), (ConfigOrigins{{"a.b", "profile x"}, {"c", "--set"}}));
  EXPECT_EQ(get_traits(reader).scan_points, 29'000U);
  EXPECT_EQ(get_conditions(reader).imu_refused, "wrong");
  EXPECT_TRUE(reader.at_end());
}

TEST(Profiles, EveryKeyBelongsToOneOfTheFrontEnds) {
  for (const ShippedProfile& profile : shipped_profiles()) {
    DenseMappingConfig dense;
    SparseMappingConfig sparse;
    std::vector<std::string> not_dense;
    std::vector<std::string> not_sparse;
    dense_mapping_table(dense).read_yaml(std::string(profile.yaml), "profile", &not_dense);
    sparse_mapping_table(sparse).read_yaml(std::string(profile.yaml), "profile", &not_sparse);
    for (const std::string& key : not_dense)
      EXPECT_EQ(std::count(not_sparse.begin(), not_sparse.end(), key), 0) << profile.name << key;
  }
}

TEST(Profiles, AHarvesterFells) {
  Log log;
  EXPECT_FALSE(read_sparse_mapping_config("", "", {}, log).config.correction.harvester.fells);
  EXPECT_TRUE(
      read_sparse_mapping_config("harvester", "", {}, log).config.correction.harvester.fells);
  EXPECT_EQ(read_dense_mapping_config("harvester", "", {}).config.odometry.voxel.range_min_m, 2.0);
}

}  // namespace
}  // namespace understory
