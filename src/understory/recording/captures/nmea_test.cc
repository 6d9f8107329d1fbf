#include "understory/recording/captures/nmea.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/recording_test_support.h"

namespace understory {
namespace {

using test::nmea_line;

std::vector<GnssFix> read_log(const std::string& text, Log& log) {
  std::istringstream ahead(text);
  std::istringstream stream(text);
  NmeaLogReader reader(stream, "test.nmea", first_nmea_day(ahead, "test.nmea"), log);
  std::vector<GnssFix> fixes;
  while (auto fix = reader.next())
    fixes.push_back(*fix);
  return fixes;
}

constexpr TimeNs kDay = 86'400 * kNsPerSecond;
constexpr TimeNs kJanuary21 = 16'821 * kDay;  // 2016-01-21

TEST(Nmea, JoinsTheSentencesOfAnEpoch) {
  Log log;
  const auto fixes = read_log(
      nmea_line("GPGGA,081802.25,3649.7478,S,00224.4542,E,4,11,0.9,120.5,M,47.0,M,,") +
          nmea_line("GPGSA,A,3,01,02,03,04,05,06,07,08,09,10,11,12,1.9,0.9,1.7") +
          nmea_line("GPRMC,081802.25,A,3649.7478,S,00224.4542,E,10.0,212.5,210116,0.0,E,R"),
      log);
  ASSERT_EQ(fixes.size(), 1U);
  const GnssFix& fix = fixes[0];
  EXPECT_EQ(fix.stamp, kJanuary21 + (8 * 3600 + 18 * 60 + 2) * kNsPerSecond + 250'000'000);
  EXPECT_NEAR(fix.latitude_deg, -(36.0 + 49.7478 / 60.0), 1e-12);
  EXPECT_NEAR(fix.longitude_deg, 2.0 + 24.4542 / 60.0, 1e-12);
  EXPECT_DOUBLE_EQ(fix.height_m, 167.5);
  EXPECT_EQ(fix.quality, 4);
  EXPECT_EQ(fix.satellites, 11);
  EXPECT_EQ(fix.hdop, 0.9);
  EXPECT_EQ(fix.vdop, 1.7);
  EXPECT_EQ(fix.track_deg, 212.5);
  EXPECT_NEAR(fix.speed_m_s, 5.14444, 1e-4);
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(Nmea, ReadsTheHeadingOfTwoAntennas) {
  Log log;
  const std::string gga = ",3649.7478,N,00224.4542,E,4,11,0.9,120.5,M,47.0,M,,";
  const std::string date = nmea_line("GPZDA,081802.00,21,01,2016,00,00");
  const auto heading_of = [&](const std::string& sentence) {
    const auto fixes =
        read_log(date + nmea_line("GPGGA,081802.00" + gga) + nmea_line(sentence), log);
    return fixes.size() == 1 ? fixes[0].heading_deg : -1.0;
  };
  EXPECT_EQ(heading_of("GPHDT,274.07,T"), 274.07);
  EXPECT_EQ(heading_of("GNTHS,12.5,A"), 12.5);
  EXPECT_EQ(heading_of("PSAT,HPR,081802.00,231.4,-1.2,,N"), 231.4);
  EXPECT_EQ(heading_of("PASHR,081802.00,359.99,T,,,,,,0.150,2,0"), 359.99);
  EXPECT_EQ(heading_of("GPHDT,0.0,T"), 0.0);
  EXPECT_TRUE(std::isnan(heading_of("PSAT,HPR,081802.00,231.4,-1.2,,G")));  // by its gyroscope
  EXPECT_TRUE(std::isnan(heading_of("PSAT,HPR,081802.00,,,,N")));
  EXPECT_TRUE(std::isnan(heading_of("GNTHS,12.5,V")));
  EXPECT_TRUE(std::isnan(heading_of("GPHDT,361.0,T")));
  EXPECT_TRUE(std::isnan(heading_of("GPHDT,12.0,M")));
  EXPECT_TRUE(std::isnan(heading_of("PASHR,081802.00,12.0,T,,,,,,0.150,0,1")));  // by an IMU alone
  EXPECT_TRUE(std::isnan(heading_of("PASHR,081802.00,12.0,M,,,,,,0.150,2,0")));
  EXPECT_TRUE(std::isnan(heading_of("PSAT,GBS,081802.00,231.4,-1.2,,N")));
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(Nmea, AHeadingWithATimeIsOfItsEpoch) {
  Log log;
  const auto gga = [](const std::string& time) {
    return nmea_line("GPGGA," + time + ",3649.7478,N,00224.4542,E,4,11,0.9,120.5,M,47.0,M,,");
  };
  const std::string date = nmea_line("GPZDA,081802.00,21,01,2016,00,00");
  // The second comes late and is of no use; the third comes before its position.
  const auto fixes =
      read_log(date + gga("081802.00") + nmea_line("PASHR,081802.00,10.0,T,,,,,,0.150,2,0") +
                   gga("081803.00") + nmea_line("PSAT,HPR,081802.00,11.0,,,N") +
                   nmea_line("PASHR,081804.00,12.0,T,,,,,,,2,0") + gga("081804.00"),
               log);
  ASSERT_EQ(fixes.size(), 3U);
  EXPECT_EQ(fixes[0].heading_deg, 10.0);
  EXPECT_EQ(fixes[0].heading_sd_deg, 0.15);
  EXPECT_TRUE(std::isnan(fixes[1].heading_deg));
  EXPECT_EQ(fixes[2].heading_deg, 12.0);
  EXPECT_TRUE(std::isnan(fixes[2].heading_sd_deg));
}

TEST(Nmea, WritesAHeadingThatItReadsBack) {
  GnssFix fix;
  fix.stamp = kJanuary21 + (8 * 3600 + 18 * 60 + 2) * kNsPerSecond + 250'000'000;
  fix.quality = 4;
  fix.heading_deg = 359.8765;
  const auto without = parse_nmea(nmea_heading(fix));
  ASSERT_TRUE(without);
  EXPECT_EQ(without->heading_deg, 359.8765);
  EXPECT_FALSE(without->heading_sd_deg);
  fix.heading_sd_deg = 0.25;
  const auto with = parse_nmea(nmea_heading(fix));
  ASSERT_TRUE(with);
  EXPECT_EQ(with->heading_sd_deg, 0.25);
  EXPECT_EQ(with->time_of_day, fix.stamp - kJanuary21);
}

TEST(Nmea, DatesEpochsBeforeTheFirstDateAndAcrossMidnight) {
  Log log;
  const std::string gga = ",3649.7478,N,00224.4542,E,1,11,0.9,120.5,M,47.0,M,,";
  const auto fixes = read_log(
      nmea_line("GPGGA,235958.00" + gga) + nmea_line("GPGGA,000001.00" + gga) +
          nmea_line("GPZDA,000002.00,21,01,2016,00,00") + nmea_line("GPGGA,000002.00" + gga),
      log);
  ASSERT_EQ(fixes.size(), 3U);
  EXPECT_EQ(fixes[0].stamp, kJanuary21 - 2 * kNsPerSecond);
  EXPECT_EQ(fixes[1].stamp, kJanuary21 + 1 * kNsPerSecond);
  EXPECT_EQ(fixes[2].stamp, kJanuary21 + 2 * kNsPerSecond);
}

TEST(Nmea, LeavesOutWhatIsNoFix) {
  Log log;
  std::string damaged = nmea_line("GPRMC,081803.00,A,3649.7478,N,00224.4542,W,0.5,,210116,0.0,E,A");
  damaged[20] = '7';
  const auto fixes = read_log(
      damaged + nmea_line("GPRMC,081804.00,V,,,,,,,210116,,,N") +
          nmea_line("GPRMC,081805.00,A,9949.7478,N,00224.4542,W,0.5,,210116,0.0,E,A") + "junk\r\n" +
          "$GPRMC,081806.00,A,3649.7478,N,00224.4542,W,0.5,,210116,0.0,E,A\r\n",
      log);
  ASSERT_EQ(fixes.size(), 1U);  // the last one has no checksum, which is allowed
  EXPECT_EQ(fixes[0].stamp % (60 * kNsPerSecond), 6 * kNsPerSecond);
  EXPECT_EQ(test::count_of(log, "recording.damaged_line"), 1U);
}

TEST(Nmea, WithoutAnyDateThereIsNoTime) {
  Log log;
  EXPECT_TRUE(
      read_log(nmea_line("GPGGA,081802.00,3649.7478,N,00224.4542,E,1,11,0.9,120.5,M,47.0,M,,"), log)
          .empty());
  EXPECT_EQ(test::count_of(log, "recording.gnss_date"), 1U);
}

struct Counted {
  int sentences = 0;
  std::set<std::string> times;
};

// GGA sentences with a quality other than 0, counted by the text alone.
Counted count_positions(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::string line;
  Counted counted;
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    std::string type, time, skipped, quality;
    std::getline(cells, type, ',');
    std::getline(cells, time, ',');
    for (int i = 0; i < 4; ++i)
      std::getline(cells, skipped, ',');
    std::getline(cells, quality, ',');
    if (type.size() < 6 || type.substr(3) != "GGA" || quality.empty() || quality == "0") continue;
    ++counted.sentences;
    counted.times.insert(time);
  }
  return counted;
}

// Logs of phones under trees, some of which hold sentences twice.
TEST(Nmea, ReadsLogsOfPhones) {
  const std::filesystem::path folder = test::data_folder() / "gnss_canopy";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no example data";
  int logs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".nmea") continue;
    ++logs;
    Log log;
    std::ifstream ahead(entry.path());
    std::ifstream stream(entry.path());
    NmeaLogReader reader(stream, entry.path(), first_nmea_day(ahead, "test.nmea"), log);
    int fixes = 0;
    while (const auto fix = reader.next()) {
      ++fixes;
      EXPECT_NEAR(to_seconds(fix->stamp), 1561558000.0, 86'400.0);  // 2019-06-26
      EXPECT_NEAR(fix->latitude_deg, 51.5, 0.5);
      EXPECT_NEAR(fix->longitude_deg, 9.9, 0.5);
      EXPECT_GT(fix->quality, 0);
    }
    const Counted counted = count_positions(entry.path());
    EXPECT_GE(fixes, static_cast<int>(counted.times.size())) << entry.path();
    EXPECT_LE(fixes, counted.sentences + 1) << entry.path();
  }
  EXPECT_EQ(logs, 8);
}

}  // namespace
}  // namespace understory
