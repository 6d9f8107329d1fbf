#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "understory/recording/captures/pcap_file.h"
#include "understory/recording/captures/udp.h"

namespace understory {

// Where datagrams come from and go to. Some sensors of one maker leave the works with the same
// address. Those are told apart by the address of the link layer, if the capture has it.
struct UdpStream {
  std::uint64_t device = 0;  // as in Datagram
  std::uint32_t source = 0;
  std::uint32_t port = 0;
  auto operator<=>(const UdpStream&) const = default;  // NOLINT(modernize-use-nullptr)
  [[nodiscard]] std::string name() const { return "udp " + std::to_string(port); }
  // Where several sensors send to one port: "udp 2368 from 192.168.1.201".
  [[nodiscard]] std::string full_name() const { return name() + " from " + address(); }
  // Where several of them have one address: "udp 2368 from 192.168.1.201 (60:76:88:00:00:01)".
  [[nodiscard]] std::string device_name() const;
  [[nodiscard]] bool is_named(const std::string& text) const {
    return text == name() || text == full_name() || text == device_name();
  }
  // Whether both come from one sensor.
  [[nodiscard]] bool same_sensor(const UdpStream& other) const {
    return source == other.source && device == other.device;
  }
  // "192.168.1.201"; meaningless for IPv6.
  [[nodiscard]] std::string address() const {
    return std::to_string(source >> 24) + "." + std::to_string(source >> 16 & 255) + "." +
           std::to_string(source >> 8 & 255) + "." + std::to_string(source & 255);
  }
};

// The stream that a datagram belongs to.
[[nodiscard]] inline UdpStream stream_of(const Datagram& datagram) {
  return {datagram.device, datagram.source, datagram.port};
}

// What the datagrams of a capture are, as far as they were looked at.
struct PcapSurvey {
  struct Stream {
    std::uint64_t datagrams = 0;
    std::uint64_t velodyne = 0;  // Velodyne data packets
    std::uint64_t hesai = 0;     // of models that are read
    std::uint64_t livox = 0;     // packets of points
    std::uint64_t livox_imu = 0;
    std::string model;           // of a Hesai or Livox, where the packets tell it
    std::string unread;          // a lidar whose packets are not read: "a Pandar128 ..."
    std::uint64_t ouster = 0;    // of the size that Ouster's metadata gives
    std::uint64_t position = 0;  // Velodyne position packets
    std::map<std::size_t, std::uint64_t> by_size;  // at most 16 sizes
    // Makers whose lidars are read, of which packets are in the stream.
    [[nodiscard]] int makers() const {
      return (velodyne > 0 ? 1 : 0) + (hesai > 0 ? 1 : 0) + (livox > 0 ? 1 : 0);
    }
    [[nodiscard]] bool has_lidar() const {
      return velodyne > 0 || ouster > 0 || hesai > 0 || livox > 0;
    }
  };
  std::map<UdpStream, Stream> streams;  // at most 256; of more, those without a lidar are left out
  std::uint64_t frames = 0;             // looked at
  bool whole = false;                   // to the end of the capture
  std::uint64_t good_checksums = 0;
  std::uint64_t bad_checksums = 0;
  // Checksums tell of damage only where most are right: a capture made on the sending machine has
  // none of them filled in.
  [[nodiscard]] bool trust_checksums() const { return good_checksums > 10 * bad_checksums; }
  // What lidars there are whose packets are not read; empty: none.
  [[nodiscard]] std::string unread() const;
  // The name of a stream. It has the address where other lidars send to the same port, and that of
  // the link layer where they share the address.
  [[nodiscard]] std::string name_of(const UdpStream& key) const;
  // For messages: "1500 frames: udp 7502: 192 x 8448 bytes, ..."
  [[nodiscard]] std::string list() const;
};

// Whether a datagram begins as one of Velodyne's; it may be cut.
[[nodiscard]] bool begins_as_velodyne(ByteSpan payload);
// Whether a datagram is one of Velodyne's, by its length and its first bytes.
[[nodiscard]] bool is_velodyne_data(ByteSpan payload);
[[nodiscard]] bool is_velodyne_position(ByteSpan payload);

// The lidar that is looked for.
struct PcapWanted {
  bool velodyne = true;
  bool hesai = true;
  bool livox = true;
  std::size_t ouster_packet_size = 0;  // of the payload; 0: no Ouster
  std::string stream;                  // "udp 2368"; empty: any
};

// Looks at 20 000 frames from where the file stands. If the lidar is not among them, it looks at as
// many behind the lidar's first packet.
[[nodiscard]] PcapSurvey survey_pcap(PcapFile& file, const PcapWanted& wanted);

// The path of the only .json file beside a capture that belongs to it; empty if there is none. Its
// name begins the capture's name (walk.json, walk_1.pcap), or it is the capture's name and a
// number, as ouster-cli names them (walk.pcap, walk_0.json). Throws InputError if there are
// several.
[[nodiscard]] std::string find_ouster_metadata(const std::string& capture);

}  // namespace understory
