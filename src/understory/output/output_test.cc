#include <fcntl.h>
#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogrsf_frmts.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <laszip/laszip_api.h>

#include "understory/output/clouds/las_writer.h"
#include "understory/output/layers/geo_files.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

class OutputTest : public ::testing::Test {
 protected:
  [[nodiscard]] static std::string content(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  [[nodiscard]] static std::string unzipped(const fs::path& path) {
    gzFile file = gzopen(path.c_str(), "rb");
    std::string text(1 << 20, '\0');
    const int count = gzread(file, text.data(), static_cast<unsigned>(text.size()));
    gzclose(file);
    text.resize(static_cast<std::size_t>(std::max(count, 0)));
    return text;
  }
  const test::TemporaryFolder folder_;
};

TEST_F(OutputTest, AFileAppearsOnlyWhole) {
  const fs::path path = folder_ / "x.txt";
  {
    AtomicFile file(path);
    file.write("half");
    EXPECT_FALSE(fs::exists(path));
  }
  EXPECT_TRUE(fs::is_empty(folder_.path())) << "an abandoned file leaves nothing behind";
  AtomicFile file(path);
  file.write("whole");
  file.commit();
  EXPECT_EQ(content(path), "whole");
}

TEST_F(OutputTest, TheMessageNamesTheFileAndTheReason) {
  try {
    AtomicFile file(folder_ / "missing" / "run.json");
    FAIL() << "a folder that is not there cannot be written to";
  } catch (const OutputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("missing/run.json: "), std::string::npos) << text;
    EXPECT_NE(text.find("No such file"), std::string::npos) << text;
    EXPECT_EQ(text.find(".part."), std::string::npos) << text;
  }
}

TEST_F(OutputTest, AFullDiskIsToldByEveryWriter) {
  // What is written ends up on /dev/full: the part file is a link to it.
  const auto full = [&](const char* name) {
    fs::create_symlink("/dev/full", part_path(folder_ / name));
    return folder_ / name;
  };
  ASSERT_TRUE(fs::exists("/dev/full"));
  const auto tells = [](const auto& work) {
    try {
      work();
    } catch (const OutputError& error) {
      return std::string(error.what()).find("No space left") != std::string::npos;
    }
    return false;
  };
  EXPECT_TRUE(tells([&] { write_trees_csv(full("trees.csv"), {Tree{}}); }));
  EXPECT_TRUE(tells([&] {
    StatesWriter writer(full("states.csv.gz"));
    writer.add({});
    writer.commit();
  }));
  EXPECT_TRUE(tells([&] {
    LasWriter writer(full("map.laz"), {});
    Random random(1);
    for (int i = 0; i < 200'000; ++i)
      writer.add({random.uniform(), random.uniform(), random.uniform()});
    writer.commit();
  }));
}

TEST_F(OutputTest, TumHasNineDecimalsAndExactTime) {
  const fs::path path = folder_ / "trajectory.tum";
  TumWriter writer(path);
  // The same rotation with the other sign: files must not depend on which one was computed.
  const Pose pose(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {1.0, -2.25, 0.0000000004});
  writer.add({1'700'000'000'123'456'789, pose});
  writer.commit();
  EXPECT_EQ(content(path),
            "1700000000.123456789 1.000000000 -2.250000000 0.000000000 -0.500000000 0.500000000 "
            "-0.500000000 0.500000000\n");
}

TEST_F(OutputTest, StatesHoldTheUpperTriangleAndCompressAlike) {
  StateRow row;
  row.stamp = 5;
  row.velocity_in_world = {1.0, 2.0, 3.0};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j)
      row.pose_covariance(i, j) = 10.0 * std::min(i, j) + std::max(i, j);
  }
  for (const char* name : {"a.csv.gz", "b.csv.gz"}) {
    StatesWriter writer(folder_ / name);
    writer.add(row);
    writer.commit();
  }
  EXPECT_EQ(content(folder_ / "a.csv.gz"), content(folder_ / "b.csv.gz"));
  const std::string text = unzipped(folder_ / "a.csv.gz");
  EXPECT_EQ(text.substr(0, text.find(",c00")), "timestamp,vx,vy,vz,gx,gy,gz,ax,ay,az");
  EXPECT_NE(text.find(",c45,c55\n0.000000005,1.000000000,2.000000000,"), std::string::npos);
  EXPECT_NE(text.find(",4.500000000e+01,5.500000000e+01\n"), std::string::npos);
}

// The information that g2o gets must give the same cost for the same small motion. The cost follows
// from g2o's own error: translation and the vector part of the quaternion.
TEST_F(OutputTest, G2oInformationGivesTheSameCost) {
  Random random(7);
  Matrix6d root;
  for (int i = 0; i < 36; ++i)
    root(i / 6, i % 6) = random.normal();
  const Matrix6d information = root * root.transpose();
  for (int trial = 0; trial < 20; ++trial) {
    Vector6d xi;
    for (int i = 0; i < 6; ++i)
      xi[i] = 1e-4 * random.normal();
    const Pose motion = Pose::exp(xi);
    Vector6d error;
    error << motion.translation(), motion.rotation().vec();
    const double ours = xi.dot(information * xi);
    EXPECT_NEAR(error.dot(g2o_information(information) * error), ours, 1e-3 * ours);
  }
}

TEST_F(OutputTest, G2oFileHasVerticesAndEdges) {
  const fs::path path = folder_ / "graph.g2o";
  GraphEdge edge;
  edge.to = 1;
  edge.from_from_to = Pose(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0});
  edge.information.topLeftCorner<3, 3>() *= 100.0;
  write_g2o(path, {{0, Pose(), true}, {1, edge.from_from_to, false}}, {edge});
  std::istringstream lines(content(path));
  std::string word;
  std::vector<std::string> words;
  while (lines >> word)
    words.push_back(word);
  ASSERT_EQ(words.size(), 9U + 2U + 9U + 3U + 7U + 21U);
  EXPECT_EQ(words[9], "FIX");
  EXPECT_EQ(words[20], "EDGE_SE3:QUAT");
  EXPECT_DOUBLE_EQ(std::stod(words[30]), 1.0);       // translation comes first
  EXPECT_DOUBLE_EQ(std::stod(words.back()), 400.0);  // 100 per rad^2, of half angles
}

TEST_F(OutputTest, TreesAreEmptyWhereUnknown) {
  Tree tree;
  tree.id = 3;
  tree.x = 1.5;
  tree.y = -0.0001;
  tree.z = 12.25;
  tree.dbh_m = 0.2345;
  tree.observations = 99;
  write_trees_csv(folder_ / "trees.csv", {tree});
  EXPECT_EQ(content(folder_ / "trees.csv"), tree_csv_header() + "\n" + tree_csv_row(tree) + "\n");
}

TEST_F(OutputTest, GnssQuotesItsReasons) {
  GnssRow row;
  row.fix.stamp = kNsPerSecond;
  row.fix.latitude_deg = 61.25;
  row.reason = "jump of 12 m, not \"used\"";
  GnssWriter writer(folder_ / "gnss.csv");
  writer.add(row);
  writer.commit();
  const std::string text = content(folder_ / "gnss.csv");
  EXPECT_NE(text.find("\n1.000000000,,,,61.250000000,0.000000000,0.0000,,,,,,,,,,0,,,,0,"
                      "\"jump of 12 m, not \"\"used\"\"\",,\n"),
            std::string::npos)
      << text;
}

TEST_F(OutputTest, LazKeepsTheTreeAndTheHeightOfAPoint) {
  const fs::path path = folder_ / "map.laz";
  LasOptions options;
  options.trees = true;
  LasWriter writer(path, options);
  for (std::uint32_t i = 0; i < 60'000; ++i) {  // more than one chunk
    LasRecord record;
    record.x = 0.001 * i;
    record.gps_time = 0.5 * i;
    record.tree_id = i % 1000;
    record.height_above_ground = 0.25F * static_cast<float>(i % 100);
    writer.add(record);
  }
  writer.commit();

  laszip_POINTER reader = nullptr;
  ASSERT_EQ(laszip_create(&reader), 0);
  laszip_BOOL compressed = 0;
  ASSERT_EQ(laszip_open_reader(reader, path.c_str(), &compressed), 0);
  laszip_header* header = nullptr;
  laszip_get_header_pointer(reader, &header);
  EXPECT_EQ(header->point_data_record_length, 38);
  laszip_point* point = nullptr;
  laszip_get_point_pointer(reader, &point);
  for (std::uint32_t i = 0; i < 60'000; ++i) {
    ASSERT_EQ(laszip_read_point(reader), 0);
    ASSERT_EQ(point->num_extra_bytes, 8);
    std::uint32_t tree = 0;
    float height = 0.0F;
    std::memcpy(&tree, point->extra_bytes, 4);
    std::memcpy(&height, point->extra_bytes + 4, 4);
    ASSERT_EQ(tree, i % 1000);
    ASSERT_EQ(height, 0.25F * static_cast<float>(i % 100));
    ASSERT_EQ(point->gps_time, 0.5 * i);
  }
  laszip_close_reader(reader);
  laszip_destroy(reader);
}

TEST_F(OutputTest, LasHasRoomForPointsNearItsOffset) {
  LasOptions options;
  options.offset = {3e6, 6e6, 0.0};
  EXPECT_TRUE(has_room(options, {3e6 + 2'147'000.0, 6e6, 100.0}));
  EXPECT_FALSE(has_room(options, {3e6 + 2'148'000.0, 6e6, 100.0}));
  EXPECT_FALSE(has_room(options, {3e6, 6e6, -2'148'000.0}));
  LasWriter writer(folder_ / "map.las", options);
  EXPECT_THROW(writer.add({3e6, 6e6 - 2'148'000.0, 0.0}), OutputError);
}

TEST_F(OutputTest, LazComesBackToTheMillimetre) {
  const fs::path path = folder_ / "map.laz";
  LasOptions options;
  options.offset = {500'000.0, 6'800'000.0, 0.0};
  std::vector<LasRecord> points;
  Random random(3);
  for (int i = 0; i < 70'000; ++i) {  // more than one chunk
    points.push_back({500'000.0 + random.uniform(-80.0, 80.0),
                      6'800'000.0 + random.uniform(-80.0, 80.0), random.uniform(90.0, 130.0),
                      1'700'000'000 * kNsPerSecond + i * 1000, static_cast<std::uint16_t>(i),
                      static_cast<std::uint8_t>(1 + i % 5)});
  }
  LasWriter writer(path, options);
  for (const LasRecord& point : points)
    writer.add(point);
  writer.commit();

  laszip_POINTER reader = nullptr;
  ASSERT_EQ(laszip_create(&reader), 0);
  laszip_BOOL compressed = 0;
  ASSERT_EQ(laszip_open_reader(reader, path.c_str(), &compressed), 0);
  EXPECT_EQ(compressed, 1);
  laszip_header* header = nullptr;
  laszip_get_header_pointer(reader, &header);
  EXPECT_EQ(header->version_minor, 4);
  EXPECT_EQ(header->point_data_format, 6);
  EXPECT_EQ(header->extended_number_of_point_records, points.size());
  EXPECT_EQ(header->extended_number_of_points_by_return[0], points.size());
  EXPECT_NEAR(header->min_x, 499'920.0, 0.1);
  EXPECT_NEAR(header->max_z, 130.0, 0.1);
  laszip_point* point = nullptr;
  laszip_get_point_pointer(reader, &point);
  for (const LasRecord& expected : points) {
    ASSERT_EQ(laszip_read_point(reader), 0);
    double xyz[3];
    laszip_get_coordinates(reader, xyz);
    ASSERT_NEAR(xyz[0], expected.x, 0.00051);
    ASSERT_NEAR(xyz[1], expected.y, 0.00051);
    ASSERT_NEAR(xyz[2], expected.z, 0.00051);
    ASSERT_EQ(point->intensity, expected.intensity);
    ASSERT_EQ(point->extended_classification, expected.classification);
    // Unix 1,700,000,000 is GPS 1,384,035,218; adjusted standard time takes a billion off.
    ASSERT_NEAR(point->gps_time,
                384'035'218.0 + 1e-9 * static_cast<double>(expected.stamp % kNsPerSecond), 1e-6);
  }
  laszip_close_reader(reader);
  laszip_destroy(reader);
}

TEST_F(OutputTest, LazRefusesWhatDoesNotFit) {
  LasWriter writer(folder_ / "map.laz", {});
  EXPECT_THROW(writer.add({6'800'000.0, 0.0, 0.0}), OutputError);
}

TEST_F(OutputTest, GeoTiffLiesWhereTheRasterLies) {
  Raster raster;
  raster.x0 = 100.0;
  raster.y0 = 200.0;
  raster.cell_m = 0.5;
  raster.columns = 3;
  raster.rows = 2;
  raster.z0 = 1000.0;
  raster.values = {1, 2, 3, 4, std::nanf(""), 6};
  const fs::path path = folder_ / "dtm.tif";
  write_geotiff(path, raster, "");
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
  ASSERT_NE(dataset, nullptr);
  double transform[6];
  dataset->GetGeoTransform(transform);
  EXPECT_EQ(transform[0], 100.0);
  EXPECT_EQ(transform[3], 201.0);
  float values[6];
  ASSERT_EQ(dataset->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, 3, 2, values, 3, 2, GDT_Float32, 0,
                                                0, nullptr),
            CE_None);
  EXPECT_EQ(values[0], 1004.0F);  // north first
  EXPECT_EQ(values[1], dataset->GetRasterBand(1)->GetNoDataValue());
  EXPECT_EQ(values[5], 1003.0F);
}

TEST_F(OutputTest, GeoPackageHoldsTheTrees) {
  Tree tree;
  tree.id = 7;
  tree.x = 1.0;
  tree.y = 2.0;
  tree.z = 3.0;
  tree.dbh_m = 0.25;
  const fs::path path = folder_ / "trees.gpkg";
  write_trees_gpkg(path, {tree}, "");
  write_trees_gpkg(folder_ / "again.gpkg", {tree}, "");
  EXPECT_EQ(content(path), content(folder_ / "again.gpkg"));
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_VECTOR));
  ASSERT_NE(dataset, nullptr);
  OGRLayer* layer = dataset->GetLayerByName("trees");
  ASSERT_NE(layer, nullptr);
  const OGRFeatureUniquePtr feature(layer->GetNextFeature());
  ASSERT_NE(feature, nullptr);
  EXPECT_EQ(feature->GetFieldAsInteger("id"), 7);
  EXPECT_DOUBLE_EQ(feature->GetFieldAsDouble("dbh_m"), 0.25);
  EXPECT_FALSE(feature->IsFieldSetAndNotNull(feature->GetFieldIndex("height_m")));
  EXPECT_DOUBLE_EQ(feature->GetGeometryRef()->toPoint()->getZ(), 3.0);
}

TEST_F(OutputTest, RunJsonHasTheKeysThatOthersRead) {
  RunSummary summary;
  summary.command = "map";
  summary.version = "0.0";
  summary.status = RunStatus::kPartial;
  summary.reasons = {"stopped by the user"};
  summary.warnings = {{"imu.gap", "0.4 s without IMU", 2}};
  summary.config.asked_yaml =
      "ndt:\n  voxel_size_m: 0.5\n  method: ndt\n  on: true\n  list: [1, 2]\n";
  summary.quality["nothing"] = std::numeric_limits<double>::quiet_NaN();
  summary.counts["trees"] = std::int64_t{12};
  StageTimes times;
  times.add("scan", 10.0, 20.0);
  times.add("scan", 30.0, 40.0);
  for (int i = 0; i < 205; ++i)
    times.add("keyframe", 1.0, i < 20 ? 5.0 : 6.0);
  summary.stages = summarise(times);
  write_run_json(folder_ / "run.json", summary);
  const auto json = nlohmann::json::parse(content(folder_ / "run.json"));
  EXPECT_EQ(json["status"], "partial");
  EXPECT_EQ(json["warnings"][0]["count"], 2);
  EXPECT_EQ(json["stages"]["scan"]["wall_ms"]["mean"], 20.0);
  EXPECT_EQ(json["stages"]["scan"]["cpu_ms"]["max"], 40.0);
  EXPECT_FALSE(json["stages"]["scan"].contains("cpu_ms_by_tenth"));  // too few to tell
  EXPECT_EQ(json["stages"]["keyframe"]["cpu_ms_by_tenth"],
            nlohmann::json({5, 6, 6, 6, 6, 6, 6, 6, 6, 6}));
  EXPECT_EQ(json["config"]["ndt"]["voxel_size_m"], 0.5);
  EXPECT_EQ(json["config"]["ndt"]["method"], "ndt");
  EXPECT_EQ(json["config"]["ndt"]["on"], true);
  EXPECT_EQ(json["config"]["ndt"]["list"], nlohmann::json({1, 2}));
  EXPECT_TRUE(json["quality"]["nothing"].is_null());
  EXPECT_EQ(json["counts"]["trees"], 12);
}

TEST_F(OutputTest, BlocksOfScansAreMeansOfTheirScans) {
  std::vector<ScanBlock> scans;
  for (int i = 0; i < 7; ++i)
    scans.push_back({0.1 * i, 1, 1.0 * i, 2.0 * i, 100.0 + i});
  EXPECT_EQ(joined(scans, 7).size(), 7U);
  const std::vector<ScanBlock> three = joined(scans, 3);
  ASSERT_EQ(three.size(), 3U);
  EXPECT_DOUBLE_EQ(three[1].from_s, 0.1 * 3);
  EXPECT_EQ(three[1].scans, 3U);
  EXPECT_DOUBLE_EQ(three[1].wall_ms, 4.0);
  EXPECT_DOUBLE_EQ(three[1].cpu_ms, 8.0);
  EXPECT_DOUBLE_EQ(three[1].map_size, 104.0);
  EXPECT_EQ(three[2].scans, 1U);
  EXPECT_DOUBLE_EQ(joined(three, 1)[0].map_size, 103.0);
  EXPECT_TRUE(joined({}, 3).empty());

  RunSummary summary;
  EXPECT_FALSE(nlohmann::json::parse(run_json(summary)).contains("scan_blocks"));
  summary.scan_blocks = three;
  const auto json = nlohmann::json::parse(run_json(summary))["scan_blocks"];
  EXPECT_EQ(json["scans"], nlohmann::json({3, 3, 1}));
  EXPECT_EQ(json["map_size"], nlohmann::json({101, 104, 106}));
}

TEST_F(OutputTest, HashIsSha256) {
  const fs::path path = folder_ / "input.bin";
  std::ofstream(path, std::ios::binary) << "abc";  // FIPS 180-4, appendix B.1
  EXPECT_EQ(hash_input(path).sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  std::ofstream(path, std::ios::binary)
      << "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";  // B.2
  const InputHash hash = hash_input(path);
  EXPECT_EQ(hash.sha256, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(hash.bytes, 56U);
}

}  // namespace
}  // namespace understory
