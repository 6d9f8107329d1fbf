#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/hesai/hesai_test_support.h"
#include "understory/recording/captures/pcap_recording.h"
#include "understory/recording/messages/message_encode.h"
#include "understory/recording/messages/message_recording.h"
#include "understory/recording/messages/stored_messages_test_support.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::Bytes;
using test::HesaiPacket;
using test::kHesaiTime;

// Packet i of a PandarXT-32 that turns ten times a second: 250 packets a turn.
Bytes packet_at(int i) {
  HesaiPacket packet;
  packet.azimuth_cdeg = 144 * i % 36'000;
  packet.sequence = static_cast<std::uint32_t>(i);
  packet.microseconds = static_cast<std::uint32_t>(250'000 + 400 * i);
  return packet.bytes();
}

TimeNs stamp_of_packet(int i) {
  return kHesaiTime + 400'000LL * i;
}

enum class Layout { kPandarScan, kUdpFrame, kNebula };

// 125 packets a message, as the drivers' .msg files have them.
std::vector<test::Stored> topic_of(Layout layout, const std::string& type, int messages) {
  const auto topic = test::channel("/packets", type);
  std::vector<test::Stored> all;
  for (int m = 0; m < messages; ++m) {
    CdrWriter out;
    out.put_header(stamp_of_packet(125 * m), "hesai");
    out.put(std::uint32_t{125});
    for (int i = 125 * m; i < 125 * (m + 1); ++i) {
      Bytes bytes = packet_at(i);
      const auto size = static_cast<std::uint32_t>(bytes.size());
      out.put_time(stamp_of_packet(i));
      if (layout == Layout::kPandarScan) {
        bytes.resize(1500, 0);
      } else {
        out.put(size);
      }
      std::memcpy(out.put_space(bytes.size()), bytes.data(), bytes.size());
      if (layout != Layout::kNebula) out.put(size);
    }
    all.push_back({topic, stamp_of_packet(125 * (m + 1)), test::bytes_of(out.bytes())});
  }
  return all;
}

std::vector<std::size_t> points_of(Recording& recording) {
  std::vector<std::size_t> points;
  for (const Event& event : test::read_all(recording)) {
    if (const auto* scan = std::get_if<ScanPtr>(&event)) points.push_back((*scan)->points.size());
  }
  return points;
}

TEST(HesaiTopic, PacketsOfAllDriversAreRead) {
  const std::pair<Layout, const char*> all[] = {
      {Layout::kPandarScan, "pandar_msgs/msg/PandarScan"},
      {Layout::kPandarScan, "hesai_lidar/PandarScan"},
      {Layout::kUdpFrame, "hesai_ros_driver/msg/UdpFrame"},
      {Layout::kNebula, "nebula_msgs/msg/NebulaPackets"}};
  for (const auto& [layout, type] : all) {
    const std::vector<test::Stored> messages = topic_of(layout, type, 5);
    Log log;
    const auto recording = open_messages(
        "walk.mcap", [&](Log&) { return std::make_unique<test::StoredSource>(messages); }, {}, log);
    EXPECT_EQ(points_of(*recording), (std::vector<std::size_t>{64'000, 64'000, 32'000})) << type;
    EXPECT_EQ(recording->rig().lidar_model, "PandarXT-32");
    EXPECT_EQ(log.warnings().size(), test::count_of(log, "recording.no_calibration"))
        << test::all_warnings(log);
  }
}

void add_packets(Bytes& file, int count, std::uint8_t last_byte_of_address,
                 const std::function<Bytes(int)>& make) {
  for (int i = 0; i < count; ++i) {
    Bytes ip = test::make_ip(test::make_udp(2368, make(i)));
    ip[15] = last_byte_of_address;
    test::add_record(file, stamp_of_packet(i), test::make_ethernet(ip));
  }
}

TEST(HesaiTopic, ACaptureIsRead) {
  Bytes file = test::pcap_header();
  add_packets(file, 600, 201, packet_at);
  Log log;
  const auto recording = open_pcap(bytes_in_memory(file, "walk.pcap"), {}, log);
  EXPECT_EQ(recording->format(), "PCAP (Hesai PandarXT-32)");
  EXPECT_EQ(points_of(*recording), (std::vector<std::size_t>{64'000, 64'000, 25'600}));
}

// Two sensors that send to one port are told apart by their addresses.
TEST(HesaiTopic, OfTwoSensorsOnOnePortTheAddressIsNamed) {
  Bytes file = test::pcap_header();
  add_packets(file, 300, 201, packet_at);
  add_packets(file, 260, 202, packet_at);
  Log log;
  const auto recording = open_pcap(bytes_in_memory(file, "walk.pcap"), {}, log);
  EXPECT_EQ(points_of(*recording).front(), 64'000U);
  EXPECT_NE(test::all_warnings(log).find("from 192.168.1.201 are used"), std::string::npos)
      << test::all_warnings(log);
}

TEST(HesaiTopic, CapturesOfOtherSensorsAreNamed) {
  const auto refusal = [](const std::function<Bytes(int)>& make) {
    Bytes file = test::pcap_header();
    add_packets(file, 20, 201, make);
    Log log;
    try {
      (void)open_pcap(bytes_in_memory(file, "walk.pcap"), {}, log);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(refusal([](int i) {
              Bytes bytes = packet_at(i);
              bytes[2] = 1;
              bytes[3] = 4;
              return bytes;
            }).find("Pandar128"),
            std::string::npos);
  EXPECT_NE(refusal([](int) {
              Bytes bytes(1248, 0);
              bytes[0] = 0x55;
              bytes[1] = 0xAA;
              bytes[2] = 0x05;
              return bytes;
            }).find("RoboSense"),
            std::string::npos);
  const std::string said = refusal([](int) { return Bytes(77, 1); });
  EXPECT_NE(said.find("20 x 77 bytes"), std::string::npos) << said;
}

}  // namespace
}  // namespace understory
