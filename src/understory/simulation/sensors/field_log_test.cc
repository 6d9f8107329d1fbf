#include "understory/simulation/sensors/field_log.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "understory/recording/captures/nmea.h"
#include "understory/recording/extrinsics.h"
#include "understory/sensor/second_antenna_place.h"
#include "understory/simulation/simulator.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

// The drivers' tables lift each beam by what the manual calls the vertical correction.
constexpr double kLargestLift = 0.0115;

TEST(FieldLog, ReadsBackThroughTheDriverAsItWasScanned) {
  const test::TemporaryFolder folder;
  const std::string pcap = folder / "lieksa.pcap";
  std::vector<ScanPtr> scans;
  std::vector<GnssFix> fixes;
  Rig rig;
  {
    Simulator simulator(load_site("lieksa1", {"duration_s=6"}));
    rig = simulator.rig();
    FieldLogWriter writer(pcap, simulator.site(), rig);
    while (const std::optional<Event> event = simulator.next()) {
      writer.write(*event);
      if (const auto* scan = std::get_if<ScanPtr>(&*event)) scans.push_back(*scan);
      if (const auto* fix = std::get_if<GnssFix>(&*event)) fixes.push_back(*fix);
    }
    writer.finish();
  }
  Log log;
  OpenOptions options;
  options.extrinsics_file = folder / "lieksa.extrinsics.yaml";
  const auto recording = open_recording(pcap, options, log);
  std::size_t at = 0;
  std::size_t fix_at = 0;
  while (const std::optional<Event> event = recording->next()) {
    if (const auto* fix = std::get_if<GnssFix>(&*event)) {
      ASSERT_LT(fix_at, fixes.size());
      EXPECT_NEAR(fix->latitude_deg, fixes[fix_at].latitude_deg, 1e-8);
      EXPECT_NEAR(fix->longitude_deg, fixes[fix_at].longitude_deg, 1e-8);
      EXPECT_NEAR(to_seconds(fix->stamp - fixes[fix_at].stamp), 0.0, 0.011);
      ++fix_at;
    }
    const auto* read = std::get_if<ScanPtr>(&*event);
    if (read == nullptr) continue;
    ASSERT_LT(at, scans.size());
    const Scan& wanted = *scans[at++];
    ASSERT_EQ((*read)->points.size(), wanted.points.size()) << "scan " << at;
    EXPECT_NEAR(to_seconds((*read)->stamp - wanted.stamp), 0.0, 5e-5);
    // The driver's order within a firing may differ, its frame is turned by half a turn.
    double worst = 0.0;
    for (std::size_t i = 0; i < wanted.points.size(); ++i) {
      const ScanPoint& a = wanted.points[i];
      const ScanPoint& b = (*read)->points[i];
      ASSERT_EQ(a.ring, b.ring);
      ASSERT_EQ(a.intensity, b.intensity);
      const double range = std::hypot(a.x, a.y, a.z);
      // A hundredth of a degree of azimuth.
      EXPECT_NEAR(-b.x, a.x, 0.003 + 4e-4 * range);
      EXPECT_NEAR(-b.y, a.y, 0.003 + 4e-4 * range);
      worst = std::max(worst, std::abs(double(b.z) - a.z));
    }
    EXPECT_LT(worst, kLargestLift + 0.001);
  }
  EXPECT_EQ(at, scans.size());
  EXPECT_EQ(fix_at, fixes.size());
  const Eigen::Vector3d forward(5.0, 0.0, 0.0);
  EXPECT_LT(
      (recording->rig().body_from_lidar * Eigen::Vector3d(-forward) - rig.body_from_lidar * forward)
          .norm(),
      1e-5);
}

TEST(FieldLog, NmeaLogHasTheFixesWithHeightAndDilution) {
  const test::TemporaryFolder folder;
  const std::string pcap = folder / "lieksa2.pcap";
  std::vector<GnssFix> fixes;
  {
    Simulator simulator(load_site("lieksa2", {"duration_s=12", "lidar.keep_every=50"}));
    FieldLogWriter writer(pcap, simulator.site(), simulator.rig());
    while (const std::optional<Event> event = simulator.next()) {
      writer.write(*event);
      if (const auto* fix = std::get_if<GnssFix>(&*event)) fixes.push_back(*fix);
    }
    writer.finish();
  }
  Log log;
  std::ifstream stream(folder / "lieksa2.nmea");
  const std::int64_t day = first_nmea_day(stream, "lieksa2.nmea");
  EXPECT_EQ(day, fixes.front().stamp / (86'400 * kNsPerSecond));
  stream.clear();
  stream.seekg(0);
  NmeaLogReader reader(stream, "lieksa2.nmea", day, log);
  for (const GnssFix& wanted : fixes) {
    const std::optional<GnssFix> fix = reader.next();
    ASSERT_TRUE(fix.has_value());
    EXPECT_NEAR(to_seconds(fix->stamp - wanted.stamp), 0.0, 0.011);
    EXPECT_NEAR(fix->latitude_deg, wanted.latitude_deg, 1e-8);
    EXPECT_NEAR(fix->height_m, wanted.height_m, 1e-3);
    EXPECT_NEAR(fix->hdop, wanted.hdop, 0.006);
    EXPECT_NEAR(fix->vdop, wanted.vdop, 0.006);
    EXPECT_EQ(fix->satellites, wanted.satellites);
  }
  EXPECT_FALSE(reader.next().has_value());
}

TEST(FieldLog, OtherScannersAreRefused) {
  const Simulator simulator(load_site("demo", {"duration_s=1"}));
  const test::TemporaryFolder folder;
  EXPECT_THROW(FieldLogWriter(folder / "x.pcap", simulator.site(), simulator.rig()), ConfigError);
}

TEST(FieldLog, KeepsTheHeadingOfASecondAntenna) {
  const test::TemporaryFolder folder;
  const std::string pcap = folder / "two.pcap";
  std::vector<GnssFix> fixes;
  {
    Simulator simulator(
        load_site("lieksa1", {"duration_s=2", "gnss.second_antenna_m=[0.5,0.5,0]"}));
    FieldLogWriter writer(pcap, simulator.site(), simulator.rig());
    while (const std::optional<Event> event = simulator.next()) {
      if (const auto* fix = std::get_if<GnssFix>(&*event)) {
        writer.write(*event);
        fixes.push_back(*fix);
      }
    }
    writer.finish();
  }
  std::ifstream ahead(folder / "two.nmea", std::ios::binary);
  std::ifstream stream(folder / "two.nmea", std::ios::binary);
  Log log;
  NmeaLogReader reader(stream, "two.nmea", first_nmea_day(ahead, "two.nmea"), log);
  ASSERT_GT(fixes.size(), 1U);
  for (const GnssFix& fix : fixes) {
    const auto read = reader.next();
    ASSERT_TRUE(read);
    EXPECT_NEAR(read->heading_deg, fix.heading_deg, 1e-4);
    EXPECT_NEAR(read->heading_sd_deg, fix.heading_sd_deg, 1e-4);
  }
  Rig rig;
  apply_extrinsics_file(folder / "two.extrinsics.yaml", {}, rig, log);
  ASSERT_TRUE(second_antenna_of(rig));
  EXPECT_LT(
      (*second_antenna_of(rig) - rig.body_from_gnss->translation() - Eigen::Vector3d(0.5, 0.5, 0.0))
          .norm(),
      1e-5);
}

}  // namespace
}  // namespace understory
