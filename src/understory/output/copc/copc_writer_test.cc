#include "understory/output/copc/copc_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "understory/output/clouds/las_writer.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/log.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}
template <typename T>
T number_at(const std::string& bytes, std::size_t at) {
  T value{};
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

class CopcWriterTest : public ::testing::Test {
 protected:
  static LasPointSteps point(std::mt19937& random) {
    LasPointSteps steps;
    // Clumps, so that there are many levels.
    const auto clump = static_cast<std::int32_t>(random() % 20);
    steps.x = clump * 3'517 + static_cast<std::int32_t>(random() % 900);
    steps.y = clump * 7'919 % 70'000 - 5'000 + static_cast<std::int32_t>(random() % 900);
    steps.z = clump * 1'013 % 20'000 + static_cast<std::int32_t>(random() % 900);
    steps.gps_time = 100.0 + 1e-3 * static_cast<double>(random() % 1000);
    steps.intensity = static_cast<std::uint16_t>(random());
    steps.classification = static_cast<std::uint8_t>(random() % 7);
    return steps;
  }
  std::filesystem::path written(const std::string& name, std::size_t count,
                                const LasOptions& options, const CopcShape& shape) {
    CopcWriter writer(folder_ / name, options, shape);
    std::mt19937 random(5);
    for (std::size_t i = 0; i < count; ++i)
      writer.add(point(random));
    EXPECT_FALSE(std::filesystem::exists(folder_ / name));
    writer.commit();
    return folder_ / name;
  }
  PointCloudFile read(const std::filesystem::path& path) {
    Log log;
    PointCloudFile cloud = read_cloud(path, log);
    EXPECT_TRUE(log.warnings().empty());
    return cloud;
  }
  static constexpr CopcShape kSmall{5'000, 300, 30};
  test::TemporaryFolder folder_;
};

TEST_F(CopcWriterTest, OurReaderFindsTheSamePointsAsInTheLaz) {
  LasOptions options;
  options.copc = true;
  options.trees = true;
  options.offset = {385'000.0, 6'672'000.0, 0.0};
  options.crs_wkt = "LOCAL_CS[\"somewhere\",UNIT[\"metre\",1]]";
  LasWriter writer(folder_ / "map.laz", options);
  std::mt19937 random(5);
  for (int i = 0; i < 130'000; ++i) {
    const LasPointSteps steps = point(random);
    LasRecord record;
    record.x = 385'000.0 + 1e-3 * steps.x;
    record.y = 6'672'000.0 + 1e-3 * steps.y;
    record.z = 1e-3 * steps.z;
    record.gps_time = steps.gps_time;
    record.intensity = steps.intensity;
    record.classification = steps.classification;
    writer.add(record);
  }
  writer.commit();
  const PointCloudFile laz = read(folder_ / "map.laz");
  const PointCloudFile copc = read(folder_ / "map.copc.laz");
  EXPECT_EQ(copc.coordinate_system, laz.coordinate_system);
  const auto rows = [](const PointCloudFile& cloud) {
    std::vector<std::array<double, 6>> all;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      const Eigen::Vector3d at = cloud.origin + cloud.points[i].cast<double>();
      all.push_back({std::round(at.x() * 1e3), std::round(at.y() * 1e3), std::round(at.z() * 1e3),
                     cloud.gps_time[i], cloud.intensity[i],
                     static_cast<double>(cloud.classification[i])});
    }
    std::sort(all.begin(), all.end());
    return all;
  };
  ASSERT_EQ(copc.points.size(), 130'000U);
  EXPECT_EQ(rows(copc), rows(laz));
}

// Readers take the cube from its centre and half of its side, which are rounded.
TEST_F(CopcWriterTest, TheCubeHoldsTheLowestPointFarFromTheOrigin) {
  for (int i = 0; i < 20; ++i) {
    LasOptions options;
    options.offset = {385'000.0 + 0.137 * i, 6'672'000.0 + 1'003.71 * i, 120.0 + 0.3 * i};
    const std::string name = "cube" + std::to_string(i) + ".copc.laz";
    const std::string file = bytes_of(written(name, 500, options, kSmall));
    const auto half = number_at<double>(file, 375 + 54 + 24);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto centre = number_at<double>(file, 375 + 54 + 8 * axis);
      EXPECT_GE(number_at<double>(file, 187 + 16 * axis), centre - half) << i << " " << axis;
      EXPECT_LE(number_at<double>(file, 179 + 16 * axis), centre + half) << i << " " << axis;
    }
  }
}

TEST_F(CopcWriterTest, TheHeaderAndTheHierarchySayWhereThingsAre) {
  const std::filesystem::path path = written("map.copc.laz", 40'000, {}, kSmall);
  const std::string file = bytes_of(path);
  EXPECT_EQ(file.substr(377, 4), "copc");
  EXPECT_EQ(number_at<std::uint16_t>(file, 393), 1);
  EXPECT_EQ(number_at<std::uint16_t>(file, 395), 160);
  const std::size_t info = 375 + 54;
  const auto half = number_at<double>(file, info + 24);
  EXPECT_NEAR(number_at<double>(file, info + 32), 2.0 * half / 128.0, 1e-12);
  const auto page = number_at<std::uint64_t>(file, info + 40);
  const auto size = number_at<std::uint64_t>(file, info + 48);
  EXPECT_EQ(page + size, file.size());
  EXPECT_EQ(number_at<std::uint64_t>(file, 235) + 60, page);
  EXPECT_EQ(number_at<std::uint32_t>(file, 243), 1U);
  EXPECT_NEAR(number_at<double>(file, info + 56), 100.0, 1e-9);
  EXPECT_NEAR(number_at<double>(file, info + 64), 100.999, 1e-9);
  std::uint64_t points = 0;
  std::uint64_t next = number_at<std::uint32_t>(file, 96) + 8;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> chunks;
  for (std::uint64_t at = page; at < file.size(); at += 32) {
    points += static_cast<std::uint64_t>(number_at<std::int32_t>(file, at + 28));
    chunks.emplace_back(number_at<std::uint64_t>(file, at + 16),
                        number_at<std::int32_t>(file, at + 24));
  }
  EXPECT_EQ(points, 40'000U);
  EXPECT_EQ(points, number_at<std::uint64_t>(file, 247));
  std::sort(chunks.begin(), chunks.end());
  EXPECT_GT(chunks.size(), 50U);
  EXPECT_EQ(read(path).points.size(), 40'000U) << "by the table of chunks";
  for (const auto& [at, bytes] : chunks) {
    EXPECT_EQ(at, next);
    next = at + bytes;
  }
  EXPECT_EQ(number_at<std::int64_t>(file, number_at<std::uint32_t>(file, 96)),
            static_cast<std::int64_t>(next));
}

TEST_F(CopcWriterTest, TheBytesAreTheSameForAnyNumberOfThreads) {
  std::vector<std::string> files;
  for (const int threads : {1, 2, 4}) {
    with_threads(threads, [&] {
      files.push_back(bytes_of(written(std::to_string(threads) + ".copc.laz", 30'000, {}, kSmall)));
    });
  }
  EXPECT_EQ(files[0], files[1]);
  EXPECT_EQ(files[0], files[2]);
}

TEST_F(CopcWriterTest, FilesWithoutPointsAndWithOneCanBeRead) {
  EXPECT_EQ(read(written("one.copc.laz", 1, {}, {})).points.size(), 1U);
  const std::string empty = bytes_of(written("none.copc.laz", 0, {}, {}));
  EXPECT_EQ(number_at<std::uint64_t>(empty, 247), 0U);
  EXPECT_EQ(number_at<std::uint64_t>(empty, 375 + 54 + 48), 32U) << "the root, without points";
}

TEST_F(CopcWriterTest, WhatIsStoppedOrNotCommittedLeavesNothing) {
  const auto begun = [&](const std::string& name) {
    auto writer = std::make_unique<CopcWriter>(folder_ / name, LasOptions{}, kSmall);
    std::mt19937 random(5);
    for (int i = 0; i < 20'000; ++i)
      writer->add(point(random));
    return writer;
  };
  begun("a.copc.laz").reset();
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  auto stopped = begun("b.copc.laz");
  EXPECT_THROW(stopped->commit(ProgressSink().stopped_by([] { return true; })), Stopped);
  stopped.reset();
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  EXPECT_THROW(CopcWriter(folder_ / "missing" / "map.copc.laz", {}), OutputError);
}

TEST_F(CopcWriterTest, DegreesBesideMetresDoNotSuit) {
  LasOptions degrees;
  EXPECT_TRUE(suits_copc(degrees));
  degrees.scale = {1e-8, 1e-8, 1e-3};
  EXPECT_FALSE(suits_copc(degrees));
  EXPECT_EQ(copc_path("RUN/map.laz"), std::filesystem::path("RUN/map.copc.laz"));
}

}  // namespace
}  // namespace understory
