#include <gtest/gtest.h>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/hesai/hesai_test_support.h"
#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/recording/captures/pcap_survey.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::Bytes;
using test::kHourStart;
using test::velodyne_udp;

constexpr int kPackets = 150;  // two turns

TimeNs stamp_of(int i) {
  return kHourStart + i * 1'327'000LL;
}

using Wrap = Bytes (*)(const Bytes& ip);

Bytes plain(const Bytes& ip) {
  return test::make_ethernet(ip);
}

Bytes make_capture(Wrap wrap = plain, std::uint32_t link_type = 1) {
  Bytes file = test::pcap_header(link_type);
  for (int i = 0; i < kPackets; ++i)
    test::add_record(file, stamp_of(i), wrap(test::make_ip(velodyne_udp(i))));
  return file;
}

struct ReadCapture {
  std::size_t scans = 0;
  std::size_t points = 0;
  std::string format;
};

ReadCapture read_capture(const Bytes& file, Log& log) {
  const auto recording = open_pcap(bytes_in_memory(file, "test.pcap"), {}, log);
  ReadCapture result;
  while (const auto event = recording->next()) {
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) {
      ++result.scans;
      result.points += (*scan)->points.size();
    }
  }
  result.format = recording->format();
  return result;
}

void expect_all(const Bytes& file) {
  Log log;
  const ReadCapture result = read_capture(file, log);
  EXPECT_EQ(result.scans, 2U);
  EXPECT_EQ(result.points, kPackets * 384U);
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(Pcap, ReadsEthernetVlanCookedAndRaw) {
  expect_all(make_capture());
  expect_all(make_capture([](const Bytes& ip) { return test::make_ethernet(ip, true); }));
  expect_all(make_capture(
      [](const Bytes& ip) {
        Bytes frame(16, 0);
        frame[14] = 0x08;
        test::append(frame, ip);
        return frame;
      },
      113));
  expect_all(make_capture(
      [](const Bytes& ip) {
        Bytes frame(20, 0);
        frame[0] = 0x08;
        test::append(frame, ip);
        return frame;
      },
      276));
  expect_all(make_capture([](const Bytes& ip) { return ip; }, 101));
}

TEST(Pcap, PutsFragmentsTogetherInAnyOrder) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < kPackets; ++i) {
    const Bytes udp = velodyne_udp(i);
    const Bytes head(udp.begin(), udp.begin() + 800);
    const Bytes tail(udp.begin() + 800, udp.end());
    const auto id = static_cast<std::uint16_t>(i);
    const Bytes first = test::make_ethernet(test::make_ip(head, 0, true, id));
    const Bytes second = test::make_ethernet(test::make_ip(tail, 800, false, id));
    test::add_record(file, stamp_of(i), i % 2 == 0 ? first : second);
    test::add_record(file, stamp_of(i), i % 2 == 0 ? second : first);
  }
  expect_all(file);
}

Bytes block(std::uint32_t type, Bytes body) {
  body.resize((body.size() + 3) / 4 * 4, 0);
  const auto length = static_cast<std::uint32_t>(body.size() + 12);
  Bytes bytes;
  test::put(bytes, type);
  test::put(bytes, length);
  test::append(bytes, body);
  test::put(bytes, length);
  return bytes;
}

TEST(Pcap, ReadsPcapng) {
  Bytes section;
  test::put(section, std::uint32_t{0x1A2B3C4D});
  test::put(section, std::uint32_t{1});
  test::put(section, std::int64_t{-1});
  Bytes file = block(0x0A0D0D0A, section);
  Bytes interface;
  test::put(interface, std::uint32_t{1});
  test::put(interface, std::uint32_t{65535});
  test::append(interface, {9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0});  // nanoseconds
  test::append(file, block(1, interface));
  for (int i = 0; i < kPackets; ++i) {
    const Bytes frame = plain(test::make_ip(velodyne_udp(i)));
    Bytes body;
    test::put(body, std::uint32_t{0});
    test::put(body, static_cast<std::uint32_t>(stamp_of(i) >> 32));
    test::put(body, static_cast<std::uint32_t>(stamp_of(i)));
    test::put(body, static_cast<std::uint32_t>(frame.size()));
    test::put(body, static_cast<std::uint32_t>(frame.size()));
    test::append(body, frame);
    test::append(file, block(6, body));
  }
  expect_all(file);
  Log log;
  EXPECT_EQ(read_capture(file, log).format, "PCAPNG (Velodyne VLP-16)");
}

TEST(Pcap, KeepsWhatComesBeforeTheCut) {
  Bytes file = make_capture();
  const std::size_t record = (file.size() - 24) / kPackets;
  file.resize(24 + 100 * record + 700);
  Log log;
  EXPECT_EQ(read_capture(file, log).points, 100U * 384);
  EXPECT_EQ(test::count_of(log, "recording.truncated"), 1U);
}

TEST(Pcap, GoesOnBehindADamagedRecordHeader) {
  Bytes file = make_capture();
  const std::size_t record = (file.size() - 24) / kPackets;
  file[24 + 50 * record + 10] = 0xFF;  // its length
  Log log;
  EXPECT_EQ(read_capture(file, log).points, (kPackets - 1) * 384U);
  EXPECT_EQ(test::count_of(log, "recording.damaged"), 1U) << test::all_warnings(log);
}

TEST(Pcap, LeavesOutARecordWhoseTimeIsDaysOff) {
  Bytes file = make_capture();
  const std::size_t record = (file.size() - 24) / kPackets;
  file[24 + 50 * record + 3] ^= 0x40;  // its seconds
  Log log;
  EXPECT_EQ(read_capture(file, log).points, (kPackets - 1) * 384U);
  EXPECT_EQ(test::count_of(log, "recording.damaged"), 1U) << test::all_warnings(log);
}

TEST(Pcap, NamesAPacketOfAVelodyneThatIsCut) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < kPackets; ++i) {
    test::VelodynePacket packet;
    packet.azimuth_cdeg = (480 * i) % 36000;
    packet.us = static_cast<std::uint32_t>(1327 * i);
    Bytes payload = test::make_packet(packet);
    if (i == 70) payload.resize(700);
    test::add_record(file, stamp_of(i), plain(test::make_ip(test::make_udp(2368, payload))));
  }
  Log log;
  EXPECT_EQ(read_capture(file, log).points, (kPackets - 1) * 384U);
  EXPECT_NE(test::all_warnings(log).find("has 700 bytes, expected 1206"), std::string::npos)
      << test::all_warnings(log);
}

TEST(Pcap, NamesLidarsOfAnUnknownKindWithTheWayAround) {
  const auto error_of = [](const Bytes& udp) -> std::string {
    Bytes file = test::pcap_header();
    for (int i = 0; i < 30; ++i)
      test::add_record(file, stamp_of(i), plain(test::make_ip(udp)));
    Log log;
    try {
      read_capture(file, log);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Bytes velodyne = test::make_packet({});
  velodyne.back() = 0x99;
  const std::string product = error_of(test::make_udp(2368, velodyne));
  EXPECT_NE(product.find("a Velodyne of unknown product 153"), std::string::npos) << product;
  EXPECT_NE(product.find("PointCloud2"), std::string::npos) << product;
  Bytes livox(1380, 0);
  livox[0] = 9;
  Bytes from_its_port = test::make_udp(56301, livox);
  from_its_port[0] = 56300 >> 8;  // the port of the sender
  from_its_port[1] = 56300 & 0xFF;
  const std::string version = error_of(from_its_port);
  EXPECT_NE(version.find("a Livox of unknown version 9"), std::string::npos) << version;
}

TEST(Pcap, LeavesOutPacketsWhoseChecksumIsWrong) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < kPackets; ++i) {
    Bytes udp = velodyne_udp(i);
    test::seal_udp(udp);
    if (i == 70) udp[500] ^= 0x10;
    test::add_record(file, stamp_of(i), plain(test::make_ip(udp)));
  }
  Log log;
  EXPECT_EQ(read_capture(file, log).points, (kPackets - 1) * 384U);
  EXPECT_EQ(test::count_of(log, "recording.damaged_packet"), 1U) << test::all_warnings(log);
}

// A capture made on the sending machine: no checksum is filled in yet.
TEST(Pcap, DoesNotMindChecksumsThatAreAllWrong) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < kPackets; ++i) {
    Bytes udp = velodyne_udp(i);
    udp[6] = 0x12;
    test::add_record(file, stamp_of(i), plain(test::make_ip(udp)));
  }
  expect_all(file);
}

TEST(Pcap, RefusesWhatHoldsNoLidar) {
  Log log;
  EXPECT_THROW((void)open_pcap(bytes_in_memory({1, 2, 3}, "a.pcap"), {}, log), InputError);
  EXPECT_THROW((void)open_pcap(bytes_in_memory(test::pcap_header(), "b.pcap"), {}, log),
               InputError);
  Bytes file = test::pcap_header();
  test::add_record(file, kHourStart, plain(test::make_ip(test::make_udp(7502, Bytes(3000, 1)))));
  try {
    (void)open_pcap(bytes_in_memory(file, "c.pcap"), {}, log);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("udp 7502: 1 x 3000 bytes"), std::string::npos)
        << error.what();
  }
}

// A small datagram of something else than a lidar, to another port each.
Bytes other_udp(int i) {
  return test::make_udp(static_cast<std::uint16_t>(30'000 + i), Bytes(48, 7));
}

// Bug: only the first 20,000 frames were looked at, and only the first 256 streams.
TEST(Pcap, FindsALidarThatStartsLate) {
  constexpr int kOthers = 20'500;
  Bytes file = test::pcap_header();
  for (int i = 0; i < kOthers; ++i)
    test::add_record(file, stamp_of(0), plain(test::make_ip(other_udp(i % 400))));
  Bytes with_lidar = file;
  for (int i = 0; i < kPackets; ++i)
    test::add_record(with_lidar, stamp_of(i), plain(test::make_ip(velodyne_udp(i))));
  expect_all(with_lidar);
  Log log;
  EXPECT_EQ(read_capture(with_lidar, log).format, "PCAP (Velodyne VLP-16)");
  try {
    (void)read_capture(file, log);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    const std::string said = error.what();
    EXPECT_NE(said.find("20500 frames: udp 30000: 52 x 48 bytes"), std::string::npos) << said;
    EXPECT_NE(said.find("and 236 other kinds"), std::string::npos) << said;
  }
}

// Only the lidar that was asked for ends the search.
TEST(Pcap, FindsTheLidarOfAnOptionThatStartsLate) {
  Bytes file = test::pcap_header();
  for (int i = 0; i < 20'500; ++i)
    test::add_record(file, stamp_of(i), plain(test::make_ip(velodyne_udp(i))));
  Bytes second = file;
  for (int i = 0; i < kPackets; ++i) {
    Bytes udp = velodyne_udp(i);
    udp[3] = 0x41;  // port 2369
    test::add_record(second, stamp_of(20'500 + i), plain(test::make_ip(udp)));
  }
  OpenOptions options;
  options.lidar_topic = "udp 2369";
  Log log;
  const auto recording = open_pcap(bytes_in_memory(second, "test.pcap"), options, log);
  std::size_t scans = 0;
  while (const auto event = recording->next())
    scans += std::holds_alternative<ScanPtr>(*event) ? 1 : 0;
  EXPECT_EQ(scans, 2U);
  // Without the option the second one is left out, and that is said.
  const auto first = open_pcap(bytes_in_memory(second, "test.pcap"), {}, log);
  while (first->next()) {
  }
  EXPECT_EQ(test::count_of(log, "recording.late_sensor"), 1U) << test::all_warnings(log);
}

// A frame of the sensor whose link address ends with `device`.
Bytes from_device(std::uint8_t device, const Bytes& udp) {
  Bytes frame = plain(test::make_ip(udp));
  frame[11] = device;
  return frame;
}

// Two turns of each of two lidars with the address that they had from the works, one behind the
// other's packets. The second one has a return in every other firing.
Bytes two_of_one_address() {
  Bytes file = test::pcap_header();
  for (int i = 0; i < kPackets; ++i) {
    test::VelodynePacket half;
    half.azimuth_cdeg = (480 * i) % 36000;
    half.us = static_cast<std::uint32_t>(1327 * i);
    half.distance = i % 2 == 0 ? 2500 : 0;
    test::add_record(file, stamp_of(i), from_device(0xA1, velodyne_udp(i)));
    test::add_record(file, stamp_of(i),
                     from_device(0xB2, test::make_udp(2368, test::make_packet(half))));
  }
  return file;
}

// Bug: their packets were taken for those of one sensor whose time jumps to and fro.
TEST(Pcap, TellsSensorsOfOneAddressApartByTheirLinkAddress) {
  const auto points_of = [](const std::string& name, Log& log) {
    OpenOptions options;
    options.lidar_topic = name;
    const auto recording =
        open_pcap(bytes_in_memory(two_of_one_address(), "test.pcap"), options, log);
    std::size_t points = 0;
    while (const auto event = recording->next())
      points += std::get<ScanPtr>(*event)->points.size();
    EXPECT_EQ(recording->topics().size(), 2U);
    return points;
  };
  const std::string at = "udp 2368 from 192.168.1.201 (11:11:11:11:11:";
  Log one;
  EXPECT_EQ(points_of(at + "a1)", one), kPackets * 384U);
  EXPECT_TRUE(one.warnings().empty()) << test::all_warnings(one);
  Log other;
  EXPECT_EQ(points_of(at + "b2)", other), kPackets * 192U);
  EXPECT_TRUE(other.warnings().empty()) << test::all_warnings(other);
  Log none;
  EXPECT_EQ(points_of("", none), kPackets * 384U);
  const std::string said = test::all_warnings(none);
  EXPECT_NE(said.find("packets of 2 lidars; only those of " + at + "a1) are used"),
            std::string::npos)
      << said;
}

// Lidars of two makers may share an address, and their frames may have none of their own. They
// cannot be told apart: the one with most packets is read, with a warning.
TEST(Pcap, SaysThatTwoMakersShareAnAddress) {
  Bytes file = make_capture();
  test::HesaiPacket hesai;
  for (int i = 0; i < 20; ++i)
    test::add_record(file, stamp_of(i), plain(test::make_ip(test::make_udp(2368, hesai.bytes()))));
  Log log;
  EXPECT_EQ(read_capture(file, log).points, kPackets * 384U);
  EXPECT_EQ(test::count_of(log, "recording.lidars"), 1U) << test::all_warnings(log);
}

TEST(Pcap, FindsTheMetadataBesideAnOusterCapture) {
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "drive_one.pcap", test::pcap_header());
  Log log;
  const auto message = [&] {
    try {
      (void)open_pcap(folder / "drive_one.pcap", {}, log);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message().find("--metadata"), std::string::npos);
  std::ofstream(folder / "other.json") << "{}";
  EXPECT_NE(message().find("--metadata"), std::string::npos);
  std::ofstream(folder / "drive.json") << "{}";
  EXPECT_NE(message().find("drive.json"), std::string::npos) << message();
  std::ofstream(folder / "drive_one.json") << "{}";
  EXPECT_NE(message().find("several"), std::string::npos) << message();
}

// ouster-cli writes walk.pcap and walk_0.json.
TEST(Pcap, FindsTheMetadataAsOusterCliNamesThem) {
  const test::TemporaryFolder folder;
  for (const char* name : {"walk_0.json", "walk_x.json", "walk_.json"})
    std::ofstream(folder / name) << "{}";
  EXPECT_EQ(find_ouster_metadata(folder / "walk.pcap"), folder / "walk_0.json");
  EXPECT_EQ(find_ouster_metadata(folder / "wal.pcap"), "");
}

// The real captures; what their points must be is checked by tests/recording/packages.py.
TEST(Pcap, ReadsRealCaptures) {
  const std::filesystem::path folder = test::data_folder() / "drivers";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no example data";
  Log log;
  const auto ouster = open_pcap(folder / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap", {}, log);
  const auto events = test::read_all(*ouster);
  EXPECT_EQ(events.size(), 33U);
  EXPECT_EQ(ouster->format(), "PCAP (Ouster OS-1-128)");
  EXPECT_EQ(ouster->rig().body_frame, "imu");
  const auto velodyne = open_pcap(folder / "sample_velodyne_vlp16_gps.pcap", {}, log);
  EXPECT_EQ(test::read_all(*velodyne).size(), 5U);  // it begins within a turn
  EXPECT_EQ(velodyne->rig().lidar_model, "VLP-16");
  EXPECT_EQ(log.warnings().size(), test::count_of(log, "scan.part")) << test::all_warnings(log);
}

}  // namespace
}  // namespace understory
