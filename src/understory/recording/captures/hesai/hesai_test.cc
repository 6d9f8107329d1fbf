#include "understory/recording/captures/hesai/hesai.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "understory/recording/captures/hesai/hesai_test_support.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::Bytes;
using test::HesaiPacket;
using test::kHesaiTime;

void add_hesai(HesaiDecoder& decoder, const Bytes& bytes, TimeNs stamp = kHesaiTime) {
  decoder.add_packet(bytes.data(), bytes.size(), stamp);
}

// The points of one packet, in the order of the packet.
ScanPtr decode_hesai_alone(const HesaiPacket& packet, const HesaiConfig& config = {}) {
  Log log;
  HesaiDecoder decoder(config, "test", log);
  add_hesai(decoder, packet.bytes());
  decoder.finish();
  return decoder.take_scan();
}

// Lengths of the UDP payload by the manuals: 1080 (PandarXT), 568 (PandarXT-16), 1198 (Pandar64
// with its sequence number), 1072 (PandarQT).
TEST(Hesai, PacketsHaveTheLengthsOfTheManuals) {
  const std::pair<HesaiModel, std::size_t> all[] = {{HesaiModel::kXt32, 1080},
                                                    {HesaiModel::kXt16, 568},
                                                    {HesaiModel::kPandar64, 1198},
                                                    {HesaiModel::kQt64, 1072}};
  for (const auto& [model, size] : all) {
    HesaiPacket packet;
    packet.model = model;
    const Bytes bytes = packet.bytes();
    EXPECT_EQ(bytes.size(), size);
    EXPECT_EQ(hesai_kind(bytes).model, model);
    const HesaiTable table = hesai_table(model);
    EXPECT_EQ(table.tail_begin() + table.tail_bytes + 4, size) << table.name;
    for (const auto* list : {&table.firing_us, &table.elevation_deg, &table.azimuth_deg})
      EXPECT_EQ(list->size(), table.channels) << table.name;
  }
}

struct Wanted {
  HesaiModel model;
  std::size_t block;    // from 1
  std::size_t channel;  // from 1
  double elevation_deg;
  double azimuth_deg;
  double us;  // after the packet's time
  int ring;
};

// By the manuals' tables of channels and of firing times, single return.
TEST(Hesai, DirectionsAndTimesAreThoseOfTheManuals) {
  const Wanted all[] = {
      {HesaiModel::kXt32, 8, 1, 15.0, 0.0, 6.0, 31},
      {HesaiModel::kXt32, 8, 32, -16.0, 0.0, 52.872, 0},
      {HesaiModel::kXt32, 1, 17, -1.0, 0.0, 30.192 - 350.0, 15},
      {HesaiModel::kXt16, 8, 16, -15.0, 0.0, 51.36, 0},
      {HesaiModel::kXt16, 7, 1, 15.0, 0.0, 6.0 - 50.0, 15},
      {HesaiModel::kPandar64, 6, 51, -5.565, 5.208, -42.58 - 3.62, 13},
      {HesaiModel::kPandar64, 1, 12, 1.013, -1.042, -42.58 - 5 * 55.56 - 54.668, 52},
      {HesaiModel::kPandar64, 3, 64, -24.897, -1.042, -42.58 - 3 * 55.56 - 12.748, 0},
      {HesaiModel::kQt64, 1, 1, -52.121, 8.736, 25.71 + 12.31, 0},
      {HesaiModel::kQt64, 4, 56, 36.064, -5.974, 25.71 + 500.0 + 129.6, 55}};
  for (const Wanted& wanted : all) {
    HesaiPacket packet;
    packet.model = wanted.model;
    packet.azimuth_cdeg = 4'321;
    const ScanPtr scan = decode_hesai_alone(packet);
    ASSERT_NE(scan, nullptr);
    const std::size_t channels = hesai_table(wanted.model).channels;
    const ScanPoint& point = scan->points.at((wanted.block - 1) * channels + wanted.channel - 1);
    const double azimuth =
        43.21 + 0.18 * static_cast<double>(wanted.block - 1) + wanted.azimuth_deg;
    const double flat = 10.0 * std::cos(wanted.elevation_deg * kDegree);
    EXPECT_NEAR(point.x, flat * std::sin(azimuth * kDegree), 2e-6);
    EXPECT_NEAR(point.y, flat * std::cos(azimuth * kDegree), 2e-6);
    EXPECT_NEAR(point.z, 10.0 * std::sin(wanted.elevation_deg * kDegree), 2e-6);
    EXPECT_EQ(point.ring, wanted.ring);
    EXPECT_EQ(point.intensity, 50.0F);
    EXPECT_NEAR(static_cast<double>(scan->stamp + point.t_ns - kHesaiTime), wanted.us * 1000.0, 1.0)
        << hesai_table(wanted.model).name << " channel " << wanted.channel;
    EXPECT_EQ(scan->ring_count, static_cast<int>(channels));
  }
}

TEST(Hesai, DualReturnsOfAFiringShareTheirTime) {
  HesaiPacket packet;
  packet.mode = 0x39;
  packet.other = 3000;
  const ScanPtr scan = decode_hesai_alone(packet);
  ASSERT_EQ(scan->points.size(), 4U * 64U);
  EXPECT_EQ(scan->points[0].return_index, 1);  // the less bright
  EXPECT_EQ(scan->points[1].return_index, 0);
  EXPECT_EQ(scan->points[0].t_ns, scan->points[1].t_ns);
  EXPECT_NEAR(static_cast<double>(scan->stamp + scan->points.back().t_ns - kHesaiTime), 52'872.0,
              1.0);
  EXPECT_NEAR(static_cast<double>(scan->stamp - kHesaiTime), 6'000.0 - 150'000.0, 1.0);
  packet.other = packet.distance;
  EXPECT_EQ(decode_hesai_alone(packet)->points.size(), 4U * 32U);
  packet.distance = 0;
  EXPECT_EQ(decode_hesai_alone(packet)->points.front().return_index, 0);
}

// A turn of 2000 firings, 250 packets.
std::vector<Bytes> turns(int packets) {
  std::vector<Bytes> all;
  for (int i = 0; i < packets; ++i) {
    HesaiPacket packet;
    packet.azimuth_cdeg = 144 * i % 36'000;
    packet.sequence = static_cast<std::uint32_t>(100 + i);
    packet.microseconds = static_cast<std::uint32_t>(250'000 + 400 * i);
    all.push_back(packet.bytes());
  }
  return all;
}

TimeNs stamp_at(int i) {
  return kHesaiTime + 400'000LL * i;
}

TEST(Hesai, AScanEndsWhereTheHeadPassesNorth) {
  Log log;
  HesaiDecoder decoder({}, "test", log);
  const std::vector<Bytes> packets = turns(510);
  for (int i = 0; i < 510; ++i)
    add_hesai(decoder, packets[static_cast<std::size_t>(i)], stamp_at(i));
  decoder.finish();
  for (const std::size_t points : {64'000U, 64'000U, 2'560U}) {
    const ScanPtr scan = decoder.take_scan();
    ASSERT_NE(scan, nullptr);
    EXPECT_EQ(scan->points.size(), points);
  }
  EXPECT_EQ(decoder.take_scan(), nullptr);
  EXPECT_EQ(test::count_of(log, "recording.no_calibration"), 1U);
  EXPECT_EQ(log.warnings().size(), 1U) << test::all_warnings(log);
}

TEST(Hesai, NamesPacketsThatAreCutDoubledMissingOrStrange) {
  Log log;
  HesaiDecoder decoder({}, "test", log);
  std::vector<Bytes> packets = turns(12);
  packets[2].resize(900);
  packets.insert(packets.begin() + 5, packets[4]);
  packets.erase(packets.begin() + 8);
  packets[9][1052 + 10] = 0x55;  // its return mode
  packets.push_back({1, 2, 3});
  HesaiPacket other;
  other.model = HesaiModel::kXt16;
  packets.push_back(other.bytes());
  Bytes pandar128 = packets[0];
  pandar128[2] = 1;
  pandar128[3] = 4;
  packets.push_back(pandar128);
  for (std::size_t i = 0; i < packets.size(); ++i)
    add_hesai(decoder, packets[i], stamp_at(static_cast<int>(i)));
  decoder.finish();
  EXPECT_EQ(decoder.take_scan()->points.size(), 9U * 256U);
  const std::string all = test::all_warnings(log);
  // Of one key the log keeps the first message. Each was counted: the cut one and the step over it,
  // the double, the missing, the mode, and the three at the end.
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 8U) << all;
  EXPECT_NE(all.find("has 900 bytes, expected 1080"), std::string::npos) << all;
}

TEST(Hesai, AFiringWithAnImpossibleAzimuthIsLeftOutAndSaid) {
  Log log;
  HesaiDecoder whole({}, "walk.pcap", log);
  HesaiDecoder broken({}, "walk.pcap", log);
  Bytes packet = HesaiPacket{}.bytes();
  whole.add_packet(packet.data(), packet.size(), kHesaiTime);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 0U);
  const std::size_t third = 12 + 2 * (2 + 32 * 4);  // header, then blocks of 32 channels
  packet[third] = 0x40;
  packet[third + 1] = 0x9C;  // 400.00 degrees
  broken.add_packet(packet.data(), packet.size(), kHesaiTime);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 1U);
  whole.finish();
  broken.finish();
  const ScanPtr all = whole.take_scan();
  const ScanPtr rest = broken.take_scan();
  ASSERT_NE(all, nullptr);
  ASSERT_NE(rest, nullptr);
  EXPECT_EQ(rest->points.size() + 32, all->points.size());
}

TEST(Hesai, SaysWhatItDoesNotRead) {
  Bytes packet = HesaiPacket().bytes();
  packet[2] = 4;
  packet[3] = 3;
  EXPECT_NE(hesai_kind(packet).other.find("AT128"), std::string::npos);
  packet[2] = 6;
  packet[3] = 1;
  packet[7] = 6;
  EXPECT_NE(hesai_kind(packet).other.find("XT32M"), std::string::npos);
  EXPECT_EQ(hesai_kind(Bytes{1, 2}).other, "no Hesai");
}

TEST(Hesai, UsesTheStampsWhereTheSensorHasNoUtc) {
  Log log;
  HesaiDecoder decoder({}, "test", log);
  const std::vector<Bytes> packets = turns(20);
  for (int i = 0; i < 20; ++i)
    add_hesai(decoder, packets[static_cast<std::size_t>(i)], stamp_at(i) + 5'000 * kNsPerSecond);
  decoder.finish();
  const TimeNs begin = decoder.take_scan()->stamp;
  EXPECT_NEAR(to_seconds(begin - kHesaiTime), 5'000.0 - 0.000344, 1e-5);
  EXPECT_NE(decoder.conventions().find("smoothed"), std::string::npos);
}

TEST(Hesai, UsesTheFilesOfTheSensor) {
  const test::TemporaryFolder folder;
  std::ofstream angles(folder / "walk_angles.csv");
  std::ofstream firings(folder / "walk_firetimes.csv");
  angles << "Channel,Elevation,Azimuth\r\n";
  firings << "Channel,fire time(us)\n";
  for (int i = 1; i <= 32; ++i) {
    angles << i << "," << 16 - i << ".25, 0.5\r\n";
    firings << i << "," << i << "\n";
  }
  angles.close();
  firings.close();
  std::ofstream(folder / "walk_notes.csv") << "no table\n";
  HesaiConfig config;
  config.calibration = find_hesai_calibration(folder / "walk.pcap", "");
  EXPECT_EQ(config.calibration.elevation_deg.size(), 32U);
  HesaiPacket packet;
  packet.azimuth_cdeg = 9'000;
  const ScanPtr scan = decode_hesai_alone(packet, config);
  const ScanPoint& point = scan->points.at(3);  // channel 4: fires 4 us after the block
  // 600 revolutions a minute are 3.6 degrees a millisecond.
  const double azimuth = (90.0 + 0.5 + 0.0144) * kDegree;
  EXPECT_NEAR(point.x, 10.0 * std::cos(12.25 * kDegree) * std::sin(azimuth), 2e-6);
  EXPECT_NEAR(point.y, 10.0 * std::cos(12.25 * kDegree) * std::cos(azimuth), 2e-6);
  EXPECT_EQ(point.t_ns, 3'000U);  // the first one fires after 1 us
}

TEST(Hesai, RefusesWrongCalibrationFiles) {
  const test::TemporaryFolder folder;
  const auto refused = [&](const std::string& text) {
    std::ofstream(folder / "a.csv") << text;
    HesaiCalibration calibration;
    try {
      read_hesai_angles(folder / "a.csv", calibration);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(refused("x,y\n1,2\n").find("line 1"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n1,2\n").find("line 2"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n1,2,x\n").find("line 2"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n1,2,3\n1,2,3\n").find("twice"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n2,2,3\n").find("each channel"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n1,95,3\n").find("up to 90"), std::string::npos);
  EXPECT_NE(refused("Channel,Elevation,Azimuth\n").find("each channel"), std::string::npos);
  // Of another sensor.
  std::ofstream(folder / "b.csv") << "Channel,Elevation,Azimuth\n1,2,3\n2,1,3\n";
  HesaiConfig config;
  read_hesai_angles(folder / "b.csv", config.calibration);
  Log log;
  HesaiDecoder decoder(config, "walk.pcap", log);
  try {
    add_hesai(decoder, HesaiPacket().bytes());
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("has 2 channels"), std::string::npos) << error.what();
  }
  std::ofstream(folder / "walk_1.csv") << "Channel,Elevation,Azimuth\n";
  std::ofstream(folder / "walk_2.csv") << "Channel,Elevation,Azimuth\n";
  EXPECT_THROW((void)find_hesai_calibration(folder / "walk.pcap", ""), InputError);
}

TEST(Hesai, GoesOnWhereItWasSaved) {
  Log log;
  const std::vector<Bytes> packets = turns(400);
  HesaiDecoder whole({}, "test", log);
  HesaiDecoder first({}, "test", log);
  HesaiDecoder second({}, "test", log);
  for (int i = 0; i < 400; ++i) {
    const Bytes& packet = packets[static_cast<std::size_t>(i)];
    add_hesai(whole, packet, stamp_at(i));
    if (i == 180) {
      BinaryWriter writer;
      first.save(writer);
      BinaryReader reader(writer.bytes(), "test");
      second.load(reader);
    }
    add_hesai(i < 180 ? first : second, packet, stamp_at(i));
  }
  whole.finish();
  second.finish();
  for (int scan = 0; scan < 2; ++scan)
    test::expect_same(*whole.take_scan(), *second.take_scan());
}

}  // namespace
}  // namespace understory
