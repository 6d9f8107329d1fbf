#include "understory/recording/captures/udp.h"

#include <algorithm>
#include <cstring>

#include "understory/recording/messages/event_bytes.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kMostPartials = 16;
constexpr std::uint8_t kUdp = 17;
constexpr std::uint16_t kTypeIpv4 = 0x0800;
constexpr std::uint16_t kTypeIpv6 = 0x86DD;

std::uint16_t be16(ByteSpan bytes, std::size_t at) {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}

std::uint32_t be32(ByteSpan bytes, std::size_t at) {
  return (static_cast<std::uint32_t>(be16(bytes, at)) << 16) | be16(bytes, at + 2);
}

// The part of a frame behind the link layer, if it is IP.
std::optional<ByteSpan> ip_packet(int link_type, ByteSpan frame) {
  std::size_t skip = 0;
  std::size_t type_at = 0;
  switch (link_type) {
    case 1:  // Ethernet
      skip = 14;
      type_at = 12;
      break;
    case 113:  // Linux cooked
      skip = 16;
      type_at = 14;
      break;
    case 276:  // Linux cooked 2
      skip = 20;
      type_at = 0;
      break;
    case 0:  // loopback, with the address family before the packet
    case 108:
      return frame.size() > 4 ? std::optional(frame.subspan(4)) : std::nullopt;
    case 12:  // raw IP, by various names
    case 14:
    case 101:
    case 228:
    case 229:
      return frame;
    default:
      return std::nullopt;
  }
  if (frame.size() < skip) return std::nullopt;
  std::uint16_t type = be16(frame, type_at);
  while (type == 0x8100 || type == 0x88A8 || type == 0x9100) {  // VLAN tags
    if (frame.size() < skip + 4) return std::nullopt;
    type = be16(frame, skip + 2);
    skip += 4;
  }
  if (type != kTypeIpv4 && type != kTypeIpv6) return std::nullopt;
  return frame.subspan(skip);
}

// Where a frame came from: its link address of six bytes, as a number; 0 where there is none.
std::uint64_t device_of(int link_type, ByteSpan frame) {
  constexpr std::size_t kBytes = 6;
  std::size_t at = 0;
  switch (link_type) {
    case 1:
      at = 6;
      break;
    case 113:
      if (frame.size() < 16 || be16(frame, 4) != kBytes) return 0;
      at = 6;
      break;
    case 276:
      if (frame.size() < 20 || frame[11] != kBytes) return 0;
      at = 12;
      break;
    default:
      return 0;
  }
  if (frame.size() < at + kBytes) return 0;
  return (static_cast<std::uint64_t>(be16(frame, at)) << 32) | be32(frame, at + 2);
}

std::uint32_t sum_words(ByteSpan bytes, std::uint32_t sum) {
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2)
    sum += be16(bytes, i);
  if (bytes.size() % 2 == 1) sum += static_cast<std::uint32_t>(bytes.back()) << 8;
  return sum;
}

bool checksum_fits(ByteSpan addresses, ByteSpan udp) {
  std::uint32_t sum = sum_words(addresses, kUdp + static_cast<std::uint32_t>(udp.size()));
  sum = sum_words(udp, sum);
  while (sum > 0xFFFF)
    sum = (sum & 0xFFFF) + (sum >> 16);
  return sum == 0xFFFF;
}

std::optional<Datagram> udp_datagram(ByteSpan udp, ByteSpan addresses, TimeNs stamp) {
  if (udp.size() < 8) return std::nullopt;
  const std::size_t length = be16(udp, 4);
  if (length < 8 || length > udp.size()) return std::nullopt;
  udp = udp.first(length);
  Datagram datagram;
  datagram.stamp = stamp;
  datagram.source_port = be16(udp, 0);
  datagram.port = be16(udp, 2);
  datagram.has_checksum = be16(udp, 6) != 0;
  datagram.checksum_ok = datagram.has_checksum && checksum_fits(addresses, udp);
  datagram.payload = udp.subspan(8);
  return datagram;
}

}  // namespace

std::optional<Datagram> UdpAssembler::add(int link_type, ByteSpan frame, TimeNs stamp) {
  const auto packet = ip_packet(link_type, frame);
  if (!packet || packet->empty()) return std::nullopt;
  const std::uint64_t device = device_of(link_type, frame);
  std::optional<Datagram> datagram;
  switch ((*packet)[0] >> 4) {
    case 4:
      datagram = ipv4(*packet, device, stamp);
      break;
    case 6:
      datagram = ipv6(*packet, stamp);
      break;
    default:
      break;
  }
  if (datagram) datagram->device = device;
  return datagram;
}

std::optional<Datagram> UdpAssembler::ipv4(ByteSpan packet, std::uint64_t device, TimeNs stamp) {
  if (packet.size() < 20) return std::nullopt;
  const std::size_t header = static_cast<std::size_t>(packet[0] & 0xF) * 4;
  const std::size_t total = be16(packet, 2);
  if (header < 20 || total < header || total > packet.size() || packet[9] != kUdp)
    return std::nullopt;
  const ByteSpan addresses = packet.subspan(12, 8);
  const std::uint16_t flags = be16(packet, 6);
  const bool more = (flags & 0x2000) != 0;
  const std::size_t offset = static_cast<std::size_t>(flags & 0x1FFF) * 8;
  ByteSpan body = packet.subspan(header, total - header);
  if (more || offset > 0) {
    const Key key{device, be32(packet, 12), be32(packet, 16), be16(packet, 4)};
    if (!add_fragment(key, offset, more, body)) return std::nullopt;
    body = whole_;
  }
  auto datagram = udp_datagram(body, addresses, stamp);
  if (datagram) datagram->source = be32(packet, 12);
  return datagram;
}

std::optional<Datagram> UdpAssembler::ipv6(ByteSpan packet, TimeNs stamp) {
  constexpr std::size_t kHeader = 40;
  if (packet.size() < kHeader || packet[6] != kUdp) return std::nullopt;
  const std::size_t length = be16(packet, 4);
  if (kHeader + length > packet.size()) return std::nullopt;
  auto datagram = udp_datagram(packet.subspan(kHeader, length), packet.subspan(8, 32), stamp);
  if (datagram) {
    for (std::size_t at = 8; at < 24; at += 4)
      datagram->source = datagram->source * 31 + be32(packet, at);
  }
  return datagram;
}

// Adds a part; true once the datagram is whole, which then lies in whole_.
bool UdpAssembler::add_fragment(const Key& key, std::size_t offset, bool more, ByteSpan part) {
  constexpr std::size_t kLargest = 65'536;
  if (part.empty() || offset + part.size() > kLargest || (more && part.size() % 8 != 0))
    return false;
  auto place = std::find_if(partials_.begin(), partials_.end(),
                            [&](const Partial& partial) { return partial.key == key; });
  if (place == partials_.end()) {
    if (partials_.size() == kMostPartials) {
      partials_.pop_front();
      ++incomplete_;
    }
    place = partials_.insert(partials_.end(), Partial{key, {}, {}, 0});
  }
  Partial& partial = *place;
  if (partial.bytes.size() < offset + part.size()) {
    partial.bytes.resize(offset + part.size());
    partial.have.resize((partial.bytes.size() + 7) / 8, false);
  }
  std::memcpy(partial.bytes.data() + offset, part.data(), part.size());
  for (std::size_t i = offset / 8; i < (offset + part.size() + 7) / 8; ++i)
    partial.have[i] = true;
  if (!more) partial.total_size = offset + part.size();
  const std::size_t pieces = (partial.total_size + 7) / 8;
  if (partial.total_size == 0 || partial.have.size() < pieces ||
      !std::all_of(partial.have.begin(), partial.have.begin() + static_cast<std::ptrdiff_t>(pieces),
                   [](bool have) { return have; }))
    return false;
  whole_.assign(partial.bytes.begin(),
                partial.bytes.begin() + static_cast<std::ptrdiff_t>(partial.total_size));
  partials_.erase(place);
  return true;
}

void UdpAssembler::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(partials_.size()));
  for (const Partial& partial : partials_) {
    writer.put(partial.key);
    writer.put(partial.bytes);
    put_flags(writer, partial.have);
    writer.put(static_cast<std::uint64_t>(partial.total_size));
  }
  writer.put(incomplete_);
}

void UdpAssembler::load(BinaryReader& reader) {
  partials_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    Partial& partial = partials_.emplace_back();
    partial.key = reader.get<Key>();
    partial.bytes = reader.get_vector<std::uint8_t>();
    partial.have = get_flags(reader);
    partial.total_size = static_cast<std::size_t>(reader.get<std::uint64_t>());
    if (partial.have.size() != (partial.bytes.size() + 7) / 8 ||
        partial.total_size > partial.bytes.size())
      throw InputError("checkpoint", "parts of a datagram", "expected a mark for every 8 bytes");
  }
  incomplete_ = reader.get<std::uint64_t>();
}

}  // namespace understory
