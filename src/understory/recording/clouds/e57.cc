#include "understory/recording/clouds/e57.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <pugixml.hpp>

#include "understory/recording/clouds/e57_pages.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr std::uint64_t kMostXmlBytes = 256U << 20U;
constexpr std::uint64_t kMostScans = 100'000;
constexpr std::size_t kMostE57Fields = 1'000;
constexpr std::uint64_t kMostAlike = 1'000'000;  // points without a stored number
constexpr std::size_t kPacketHead = 4;
constexpr std::uint8_t kDataPacket = 1;

// The first 48 bytes.
struct FileHead {
  std::array<char, 8> signature{};
  std::uint32_t major = 0;
  std::uint32_t minor = 0;
  std::uint64_t length = 0;
  std::uint64_t xml_position = 0;
  std::uint64_t xml_length = 0;
  std::uint64_t page_size = 0;
};

// An element's number; where it is empty or absent, `otherwise`. In E57 an empty one is zero.
double number_of(const pugi::xml_node& node, const char* child, double otherwise) {
  const pugi::xml_node element = node.child(child);
  if (!element) return otherwise;
  return to_number(element.child_value()).value_or(0.0);
}

Pose pose_of(const pugi::xml_node& scan, const std::string& file) {
  const pugi::xml_node pose = scan.child("pose");
  if (!pose) return {};
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  if (const pugi::xml_node q = pose.child("rotation")) {
    rotation = Eigen::Quaterniond(number_of(q, "w", 1.0), number_of(q, "x", 0.0),
                                  number_of(q, "y", 0.0), number_of(q, "z", 0.0));
  }
  const pugi::xml_node t = pose.child("translation");
  const Eigen::Vector3d translation(number_of(t, "x", 0.0), number_of(t, "y", 0.0),
                                    number_of(t, "z", 0.0));
  if (!rotation.coeffs().allFinite() || rotation.norm() < 1e-6 || !translation.allFinite())
    throw InputError(file, "pose", "expected a rotation and a translation of finite numbers");
  return {rotation.normalized(), translation};
}

std::int64_t integer_of(const pugi::xml_node& node, const char* name, std::int64_t otherwise) {
  const pugi::xml_attribute attribute = node.attribute(name);
  return attribute ? attribute.as_llong(otherwise) : otherwise;
}

E57Field field_of(const pugi::xml_node& node) {
  E57Field field;
  field.name = node.name();
  const std::string type = node.attribute("type").value();
  if (type == "Float") {
    const std::string precision = node.attribute("precision").value();
    field.kind = precision == "single" ? E57Field::Kind::kFloat : E57Field::Kind::kDouble;
  } else if (type == "Integer" || type == "ScaledInteger") {
    field.kind = E57Field::Kind::kInteger;
    field.least = integer_of(node, "minimum", std::numeric_limits<std::int64_t>::min());
    const std::int64_t most = integer_of(node, "maximum", std::numeric_limits<std::int64_t>::max());
    if (most < field.least) field.kind = E57Field::Kind::kOther;  // no number lies between
    const std::uint64_t span =
        static_cast<std::uint64_t>(most) - static_cast<std::uint64_t>(field.least);
    field.bits = std::bit_width(span);
    if (type == "ScaledInteger") {
      field.scale = to_number(node.attribute("scale").value()).value_or(1.0);
      field.offset = to_number(node.attribute("offset").value()).value_or(0.0);
    }
  }
  return field;
}

// All leaves of a structure, depth first: that is the order of their streams.
void add_fields(const pugi::xml_node& structure, int depth, std::vector<E57Field>& fields) {
  for (const pugi::xml_node& node : structure.children()) {
    if (node.type() != pugi::node_element || fields.size() >= kMostE57Fields) continue;
    if (std::string_view(node.attribute("type").value()) == "Structure" && depth < 8)
      add_fields(node, depth + 1, fields);
    else
      fields.push_back(field_of(node));
  }
}

E57Scan scan_of(const pugi::xml_node& node, const std::string& file) {
  E57Scan scan;
  scan.name = node.child("name").child_value();
  const pugi::xml_node points = node.child("points");
  scan.points = points.attribute("recordCount").as_ullong();
  scan.section = points.attribute("fileOffset").as_ullong();
  if (scan.points == 0) return scan;
  scan.file_from_scan = pose_of(node, file);
  add_fields(points.child("prototype"), 0, scan.fields);
  for (const pugi::xml_node& codec : points.child("codecs").children()) {
    if (codec.type() == pugi::node_element && !codec.child("bitPackCodec"))
      throw InputError(file, "scan " + scan.name,
                       "expected points in bit packs, not another codec");
  }
  return scan;
}

std::string xml_of(E57Pages& pages, const FileHead& head, const std::string& file) {
  if (head.xml_length == 0 || head.xml_length > kMostXmlBytes)
    throw InputError(file, "header", "expected an XML part of at most 256 MB");
  std::string text(head.xml_length, '\0');
  const std::size_t got =
      pages.read(head.xml_position, reinterpret_cast<std::uint8_t*>(text.data()), text.size());
  if (got < text.size())
    throw InputError(
        file, "XML part",
        pages.damaged_at() >= 0
            ? "is damaged (checksum)"
            : "the file ends before it: it is not whole, and says nowhere else what it holds");
  return text;
}

// One field's numbers, as they come packet by packet.
class FieldStream {
 public:
  explicit FieldStream(const E57Field& field) : field_(field) {}

  // Whether its numbers can be told.
  [[nodiscard]] bool known() const { return field_.kind != E57Field::Kind::kOther; }
  void append(ByteSpan bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  // How many whole numbers are there.
  [[nodiscard]] std::uint64_t available() const {
    if (bits() == 0) return std::numeric_limits<std::uint64_t>::max();
    return (8 * bytes_.size() - at_bit_) / bits();
  }
  [[nodiscard]] double next() {
    switch (field_.kind) {
      case E57Field::Kind::kFloat: {
        float value = 0.0F;
        std::memcpy(&value, bytes_.data() + at_bit_ / 8, sizeof(value));
        at_bit_ += 32;
        return static_cast<double>(value);
      }
      case E57Field::Kind::kDouble: {
        double value = 0.0;
        std::memcpy(&value, bytes_.data() + at_bit_ / 8, sizeof(value));
        at_bit_ += 64;
        return value;
      }
      default:
        return integer();
    }
  }
  // Forgets what was taken.
  void shrink() {
    const std::size_t whole = at_bit_ / 8;
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(whole));
    at_bit_ -= 8 * whole;
  }

 private:
  [[nodiscard]] std::size_t bits() const {
    if (field_.kind == E57Field::Kind::kFloat) return 32;
    if (field_.kind == E57Field::Kind::kDouble) return 64;
    return static_cast<std::size_t>(field_.bits);
  }
  // Bits follow each other from the lowest of the first byte on.
  double integer() {
    std::uint64_t value = 0;
    const std::size_t count = bits();
    for (std::size_t done = 0; done < count;) {
      const std::size_t within = at_bit_ % 8;
      const std::size_t part = std::min(8 - within, count - done);
      const std::uint64_t chunk =
          (static_cast<std::uint64_t>(bytes_[at_bit_ / 8]) >> within) & ((1U << part) - 1U);
      value |= chunk << done;
      done += part;
      at_bit_ += part;
    }
    const auto raw = static_cast<std::int64_t>(value + static_cast<std::uint64_t>(field_.least));
    return field_.scale * static_cast<double>(raw) + field_.offset;
  }

  const E57Field& field_;
  std::vector<std::uint8_t> bytes_;
  std::size_t at_bit_ = 0;
};

// The points of one scan.
class ScanReader {
 public:
  ScanReader(E57Pages& pages, const E57Scan& scan) : pages_(pages), scan_(scan) {
    streams_.reserve(scan.fields.size());
    for (const E57Field& field : scan.fields)
      streams_.emplace_back(field);
    cartesian_ = find({"cartesianX", "cartesianY", "cartesianZ"});
    spherical_ = find({"sphericalRange", "sphericalAzimuth", "sphericalElevation"});
    invalid_ = find_one(cartesian_ ? "cartesianInvalidState" : "sphericalInvalidState");
    intensity_ = find_one("intensity");
    for (const auto& three : {cartesian_, spherical_}) {
      if (three) used_.insert(used_.end(), three->begin(), three->end());
    }
    for (const auto& one : {invalid_, intensity_}) {
      if (one) used_.push_back(*one);
    }
  }

  [[nodiscard]] bool has_points() const { return cartesian_ || spherical_; }

  // The number of points that were there, invalid ones too.
  std::uint64_t read(const std::function<void(const E57Point&)>& visit) {
    std::array<std::uint64_t, 4> head{};  // of the section
    if (pages_.read(scan_.section, reinterpret_cast<std::uint8_t*>(head.data()), 32) < 32) return 0;
    std::uint64_t at = head[2];
    const std::uint64_t end = E57Pages::behind(scan_.section, head[1]);
    if (all_constant()) return give(std::min(scan_.points, kMostAlike), visit);
    std::uint64_t given = 0;
    while (given < scan_.points && at < end) {
      const std::size_t length = take_packet(at);
      if (length == 0) break;
      at = E57Pages::behind(at, length);
      given += give(scan_.points - given, visit);
    }
    return given;
  }

 private:
  using Three = std::array<std::size_t, 3>;

  [[nodiscard]] std::optional<std::size_t> find_one(const std::string& name) const {
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      if (scan_.fields[i].name == name && streams_[i].known()) return i;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::optional<Three> find(const std::array<const char*, 3>& names) const {
    Three three{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto found = find_one(names[k]);
      if (!found) return std::nullopt;
      three[k] = *found;
    }
    return three;
  }
  [[nodiscard]] bool all_constant() const {
    return std::all_of(used_.begin(), used_.end(), [&](std::size_t i) {
      return streams_[i].available() == std::numeric_limits<std::uint64_t>::max();
    });
  }

  // Takes in a packet and returns its length; 0 where it is not there or makes no sense.
  std::size_t take_packet(std::uint64_t at) {
    packet_.resize(kPacketHead);
    if (pages_.read(at, packet_.data(), kPacketHead) < kPacketHead) return 0;
    const std::uint8_t type = packet_[0];
    const std::size_t length = 1U + (packet_[2] | static_cast<std::size_t>(packet_[3]) << 8U);
    if (type != kDataPacket) return length >= kPacketHead && type <= 2 ? length : 0;
    packet_.resize(length);
    if (length < 6 || pages_.read(at, packet_.data(), length) < length) return 0;
    ByteReader reader(ByteSpan(packet_.data(), packet_.size()));
    (void)reader.take(kPacketHead);
    const auto count = reader.get<std::uint16_t>();
    if (count != streams_.size()) return 0;
    std::vector<std::uint16_t> lengths(count);
    for (std::uint16_t& each : lengths)
      each = reader.get<std::uint16_t>();
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      const ByteSpan bytes = reader.take(lengths[i]);
      if (std::find(used_.begin(), used_.end(), i) != used_.end()) streams_[i].append(bytes);
    }
    return reader.ok() ? length : 0;
  }

  // Gives the points that are whole in all streams.
  std::uint64_t give(std::uint64_t most, const std::function<void(const E57Point&)>& visit) {
    std::uint64_t count = most;
    for (const std::size_t i : used_)
      count = std::min(count, streams_[i].available());
    for (std::uint64_t k = 0; k < count; ++k) {
      E57Point point;
      if (cartesian_) point.position = three_of(*cartesian_);
      if (spherical_) {
        const Eigen::Vector3d at = three_of(*spherical_);  // range, azimuth, elevation
        if (!cartesian_)
          point.position =
              at[0] * Eigen::Vector3d(std::cos(at[2]) * std::cos(at[1]),
                                      std::cos(at[2]) * std::sin(at[1]), std::sin(at[2]));
      }
      const bool valid = !invalid_ || streams_[*invalid_].next() == 0.0;
      if (intensity_) point.intensity = static_cast<float>(streams_[*intensity_].next());
      if (!valid) continue;
      point.position = scan_.file_from_scan * point.position;
      visit(point);
    }
    for (const std::size_t i : used_)
      streams_[i].shrink();
    return count;
  }
  Eigen::Vector3d three_of(const Three& fields) {
    Eigen::Vector3d result;
    for (int k = 0; k < 3; ++k)
      result[k] = streams_[fields[static_cast<std::size_t>(k)]].next();
    return result;
  }

  E57Pages& pages_;
  const E57Scan& scan_;
  std::vector<FieldStream> streams_;
  std::vector<std::size_t> used_;
  std::optional<Three> cartesian_;
  std::optional<Three> spherical_;
  std::optional<std::size_t> invalid_;
  std::optional<std::size_t> intensity_;
  std::vector<std::uint8_t> packet_;
};

}  // namespace

bool E57Header::has_intensity() const {
  return std::all_of(scans.begin(), scans.end(), [](const E57Scan& scan) {
    return std::any_of(scan.fields.begin(), scan.fields.end(),
                       [](const E57Field& field) { return field.name == "intensity"; });
  });
}

double E57Scan::step_at(const Eigen::Vector3d& position) const {
  const bool coarse = std::any_of(fields.begin(), fields.end(), [](const E57Field& field) {
    return field.name == "cartesianX" && field.kind == E57Field::Kind::kFloat;
  });
  if (!coarse) return 0.0;
  const auto far = static_cast<float>((file_from_scan.inverse() * position).cwiseAbs().maxCoeff());
  return static_cast<double>(std::nextafter(far, std::numeric_limits<float>::max()) - far);
}

E57Header read_e57_header(ByteSource& file) {
  E57Pages pages(file);
  FileHead head;
  static_assert(sizeof(head) == 48);
  if (pages.read(0, reinterpret_cast<std::uint8_t*>(&head), sizeof(head)) < sizeof(head))
    throw InputError(file.name(), "byte 0",
                     pages.damaged_at() >= 0 ? "the header is damaged (checksum)"
                                             : "the file ends within its header");
  if (head.major != 1 || head.page_size != 1024)
    throw InputError(file.name(), "header", "expected E57 version 1 with pages of 1,024 bytes");
  const std::string text = xml_of(pages, head, file.name());
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(text.data(), text.size());
  const pugi::xml_node root = document.child("e57Root");
  if (!parsed || !root)
    throw InputError(file.name(), "XML part",
                     std::string("is no E57 description: ") + parsed.description());
  E57Header header;
  header.coordinate_system = root.child("coordinateMetadata").child_value();
  for (const pugi::xml_node& node : root.child("data3D").children()) {
    if (node.type() != pugi::node_element || header.scans.size() >= kMostScans) continue;
    E57Scan scan = scan_of(node, file.name());
    if (scan.points > 0) header.scans.push_back(std::move(scan));
  }
  if (header.scans.empty()) throw InputError(file.name(), "XML part", "names no scan with points");
  return header;
}

void read_e57_points(ByteSource& file, const E57Header& header, Log& log,
                     const std::function<void(const E57Point&)>& visit) {
  std::uint64_t all = 0;
  for (const E57Scan& scan : header.scans) {
    E57Pages pages(file);
    ScanReader reader(pages, scan);
    if (!reader.has_points())
      throw InputError(
          file.name(), "scan " + scan.name,
          "expected the fields cartesianX, Y, Z or sphericalRange, Azimuth, Elevation");
    const std::uint64_t given = reader.read(visit);
    all += given;
    if (given == scan.points) continue;
    std::string message = file.name() + ": scan " + scan.name + ": " + std::to_string(given) +
                          " of " + std::to_string(scan.points) + " points can be read";
    if (pages.damaged_at() >= 0)
      message += ": at byte " + std::to_string(pages.damaged_at()) + " a checksum is wrong";
    report_finding(log, Finding::kDamage, message);
  }
  if (all == 0) throw InputError(file.name(), "", "not one of its points can be read");
}

}  // namespace understory
