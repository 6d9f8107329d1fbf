#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/bytes.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// One UDP datagram out of captured frames.
struct Datagram {
  TimeNs stamp = 0;          // of the frame that completed it
  std::uint32_t source = 0;  // IPv4 address; for IPv6 a hash of it
  std::uint64_t device = 0;  // address of the link layer that it came from (MAC); 0: not told
  std::uint16_t source_port = 0;
  std::uint16_t port = 0;  // destination
  bool has_checksum = false;
  bool checksum_ok = false;  // meaningful only with has_checksum
  ByteSpan payload;          // valid until the next call
};

// Takes Ethernet (with VLAN tags), Linux cooked (1 and 2), loopback and raw IP frames apart and
// puts IPv4 fragments together again. At most 16 datagrams are under way at a time (1 MiB). Any
// bytes are survived. Not thread-safe.
class UdpAssembler {
 public:
  // The datagram that this frame holds or completes, if any.
  [[nodiscard]] std::optional<Datagram> add(int link_type, ByteSpan frame, TimeNs stamp);
  // Datagrams under way, and back to them.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);
  // Fragments that never became whole.
  [[nodiscard]] std::uint64_t incomplete() const { return incomplete_; }

 private:
  struct Key {
    std::uint64_t device = 0;
    std::uint32_t source = 0;
    std::uint32_t destination = 0;
    std::uint64_t id = 0;
    bool operator==(const Key&) const = default;
  };
  struct Partial {
    Key key;
    std::vector<std::uint8_t> bytes;
    std::vector<bool> have;      // per 8 bytes
    std::size_t total_size = 0;  // 0: the last fragment has not come
  };

  [[nodiscard]] std::optional<Datagram> ipv4(ByteSpan packet, std::uint64_t device, TimeNs stamp);
  [[nodiscard]] std::optional<Datagram> ipv6(ByteSpan packet, TimeNs stamp);
  [[nodiscard]] bool add_fragment(const Key& key, std::size_t offset, bool more, ByteSpan part);

  std::deque<Partial> partials_;
  std::vector<std::uint8_t> whole_;
  std::uint64_t incomplete_ = 0;
};

}  // namespace understory
