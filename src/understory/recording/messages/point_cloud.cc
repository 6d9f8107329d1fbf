#include "understory/recording/messages/point_cloud.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

namespace understory {
namespace {

constexpr TimeNs kLongestCloud = 2 * kNsPerSecond;
constexpr std::uint32_t kMostRings = 1024;

constexpr std::string_view kIntensityNames[] = {"intensity", "i",           "reflectivity",
                                                "signal",    "reflectance", "intensities"};
constexpr std::string_view kRingNames[] = {"ring", "channel", "line",    "laser_id", "laser",
                                           "beam", "row",     "ring_id", "scan_id"};
constexpr std::string_view kTimeNames[] = {
    "t",          "time",        "timestamp",       "offset_time", "time_stamp",
    "timeoffset", "time_offset", "offsettime",      "point_time",  "point_time_offset",
    "timestamps", "rel_time",    "relative_time",   "stamp",       "t_offset",
    "ts",         "gps_time",    "timestamp_offset"};
constexpr std::string_view kReturnNames[] = {"return_index"};
constexpr std::string_view kTagNames[] = {"tag"};

template <typename Result, typename T>
Result load(const std::uint8_t* raw, bool swap) {
  std::array<std::uint8_t, sizeof(T)> bytes;
  std::memcpy(bytes.data(), raw, sizeof(T));
  if (swap) std::reverse(bytes.begin(), bytes.end());
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return static_cast<Result>(value);
}

bool same_name(std::string_view field, std::string_view name) {
  return field.size() == name.size() &&
         std::equal(field.begin(), field.end(), name.begin(), [](char a, char b) {
           return std::tolower(static_cast<unsigned char>(a)) == b;
         });
}

// Rows and columns of a cloud as far as its data reach.
struct Grid {
  std::size_t rows = 0;
  std::size_t columns = 0;
  std::size_t row_step = 0;
};

Grid grid_of(const PointCloud2Message& cloud) {
  Grid grid;
  if (cloud.point_step == 0) return grid;
  const std::size_t dense_row = static_cast<std::size_t>(cloud.width) * cloud.point_step;
  grid.row_step = std::max<std::size_t>(cloud.row_step, dense_row);
  if (cloud.height <= 1) grid.row_step = dense_row;
  grid.columns = std::min<std::size_t>(cloud.width, cloud.data.size() / cloud.point_step);
  grid.rows = grid.columns > 0 ? cloud.height : 0;
  if (grid.row_step > 0) grid.rows = std::min(grid.rows, cloud.data.size() / grid.row_step + 1);
  return grid;
}

// Calls visit(raw point, row) for every point that is there as a whole.
template <typename Visit>
void for_each_point(const PointCloud2Message& cloud, const Visit& visit) {
  const Grid grid = grid_of(cloud);
  for (std::size_t row = 0; row < grid.rows; ++row) {
    for (std::size_t column = 0; column < grid.columns; ++column) {
      const std::size_t at = row * grid.row_step + column * cloud.point_step;
      if (at + cloud.point_step > cloud.data.size()) break;
      visit(cloud.data.data() + at, row);
    }
  }
}

bool is_own_float(const CloudLayout::Slot& slot) {
  return slot.type == FieldType::kFloat32 && !slot.swap;
}

// Reads the places of points. The types are looked at once a cloud, since a dense scan has 130,000
// points and nearly every driver writes three floats.
class PositionReader {
 public:
  explicit PositionReader(const CloudLayout& layout)
      : layout_(layout),
        floats_(is_own_float(layout.x()) && is_own_float(layout.y()) && is_own_float(layout.z())) {}

  // False for NaN, infinite and zero-range points.
  bool operator()(const std::uint8_t* raw, ScanPoint& point) const {
    if (floats_) {
      std::memcpy(&point.x, raw + layout_.x().offset, sizeof(float));
      std::memcpy(&point.y, raw + layout_.y().offset, sizeof(float));
      std::memcpy(&point.z, raw + layout_.z().offset, sizeof(float));
    } else {
      point.x = static_cast<float>(layout_.x().read(raw));
      point.y = static_cast<float>(layout_.y().read(raw));
      point.z = static_cast<float>(layout_.z().read(raw));
    }
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.z)) return false;
    return point.x != 0.0F || point.y != 0.0F || point.z != 0.0F;
  }

 private:
  const CloudLayout& layout_;
  bool floats_;
};

std::uint16_t to_ring(double value) {
  return value >= 0.0 && value < 65536.0 ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
}

// Reads a slot as T. The usual type of the slot, of the same width, is copied as it is.
template <typename T, FieldType kUsual>
class SlotReader {
 public:
  explicit SlotReader(const CloudLayout::Slot& slot)
      : slot_(slot), usual_(slot.type == kUsual && !slot.swap) {}

  T operator()(const std::uint8_t* raw) const {
    if (usual_) return load<T, T>(raw + slot_.offset, false);
    if constexpr (std::is_integral_v<T>)
      return static_cast<T>(to_ring(slot_.read(raw)));
    else
      return static_cast<T>(slot_.read(raw));
  }

 private:
  const CloudLayout::Slot& slot_;
  bool usual_;
};

// Times of points in nanoseconds relative to the header stamp, before they are counted from the
// first point.
struct RelativeTimes {
  TimeConvention convention;
  CloudLayout::Slot slot;
  TimeNs header = 0;
  TimeNs foreign_start = 0;  // first point's time on the foreign clock
  TimeNs unit_ns = ns_per_unit(convention.unit_s);

  [[nodiscard]] TimeNs operator()(const std::uint8_t* raw) const {
    // Whole numbers of 32 bits need no rounding: the usual case is computed without it.
    const TimeNs time = slot.type == FieldType::kUint32 && !slot.swap
                            ? load<TimeNs, std::uint32_t>(raw + slot.offset, false) * unit_ns
                            : raw_time_to_ns(slot.read(raw), convention.unit_s);
    switch (convention.kind) {
      case TimeConvention::Kind::kOffset:
        return time + convention.shift;
      case TimeConvention::Kind::kAbsolute:
        return time - header;
      default:
        return time - foreign_start;
    }
  }
};

// First and last of the points' times, relative to the header stamp.
struct TimeRange {
  TimeNs first = std::numeric_limits<TimeNs>::max();
  TimeNs last = std::numeric_limits<TimeNs>::min();
  TimeNs before = std::numeric_limits<TimeNs>::min();

  // Whether the time is no earlier than the one before it.
  bool add(TimeNs time) {
    const bool in_order = time >= before;
    before = time;
    first = std::min(first, time);
    last = std::max(last, time);
    return in_order;
  }
};

// Makes the scan begin at its first point. Where that lies just behind the header stamp, the stamp
// itself is kept. It is the start of the revolution, in which the first beams may have missed.
// Until now the points hold the last 32 bits of their times relative to the header stamp.
void count_from_first(const TimeRange& times, TimeNs header, Scan& scan) {
  const bool keep = times.first >= 0 && times.first <= (times.last - times.first) / 4;
  if (keep) {
    scan.stamp = header;
    return;
  }
  scan.stamp = header + times.first;
  for (ScanPoint& point : scan.points)
    point.t_ns -= static_cast<std::uint32_t>(times.first);
}

}  // namespace

double CloudLayout::Slot::read(const std::uint8_t* point) const {
  return visit_field_type(
      type, [&](auto zero) { return load<double, decltype(zero)>(point + offset, swap); });
}

std::optional<CloudLayout> CloudLayout::find(const PointCloud2Message& cloud) {
  CloudLayout layout;
  const auto take = [&](std::span<const std::string_view> names, Slot& slot) -> std::string {
    for (const std::string_view name : names) {
      for (const CloudField& field : cloud.fields) {
        const std::uint32_t size = field_size(field.type);
        if (!same_name(field.name, name) || size == 0) continue;
        if (field.offset > cloud.point_step || size > cloud.point_step - field.offset) continue;
        slot = {field.offset, size, field.type, cloud.big_endian};
        return field.name;
      }
    }
    return "";
  };
  constexpr std::string_view kX[] = {"x"};
  constexpr std::string_view kY[] = {"y"};
  constexpr std::string_view kZ[] = {"z"};
  take(kX, layout.x_);
  take(kY, layout.y_);
  take(kZ, layout.z_);
  take(kIntensityNames, layout.intensity_);
  take(kRingNames, layout.ring_);
  take(kReturnNames, layout.return_index_);
  take(kTagNames, layout.tag_);
  layout.time_name_ = take(kTimeNames, layout.time_);
  if (layout.x_.size == 0 || layout.y_.size == 0 || layout.z_.size == 0) return std::nullopt;
  return layout;
}

std::string CloudLayout::time_type() const {
  switch (time_.type) {
    case FieldType::kInt8:
      return "int8";
    case FieldType::kUint8:
      return "uint8";
    case FieldType::kInt16:
      return "int16";
    case FieldType::kUint16:
      return "uint16";
    case FieldType::kInt32:
      return "int32";
    case FieldType::kUint32:
      return "uint32";
    case FieldType::kFloat32:
      return "float32";
    default:
      return "float64";
  }
}

CloudTimes measure_times(const PointCloud2Message& cloud, const CloudLayout& layout,
                         TimeNs log_time) {
  CloudTimes times;
  times.stamp = cloud.header.stamp;
  times.log_time = log_time;
  if (layout.time().size == 0) return times;
  bool any = false;
  const PositionReader read_position(layout);
  for_each_point(cloud, [&](const std::uint8_t* raw, std::size_t) {
    ScanPoint point;
    if (!read_position(raw, point)) return;
    const double time = layout.time().read(raw);
    if (!std::isfinite(time)) return;
    times.low = any ? std::min(times.low, time) : time;
    times.high = any ? std::max(times.high, time) : time;
    any = true;
  });
  return times;
}

int highest_ring(const PointCloud2Message& cloud, const CloudLayout& layout) {
  int highest = -1;
  if (!layout.has_ring()) return highest;
  for_each_point(cloud, [&](const std::uint8_t* raw, std::size_t) {
    highest = std::max(highest, static_cast<int>(to_ring(layout.ring().read(raw))));
  });
  return highest;
}

ConvertedCloud convert_cloud(const PointCloud2Message& cloud, const CloudLayout& layout,
                             const TimeConvention& convention) {
  ConvertedCloud result;
  result.scan = std::make_shared<Scan>();
  Scan& scan = *result.scan;
  scan.has_point_times = convention.kind != TimeConvention::Kind::kNone && layout.time().size > 0;
  scan.stamp = cloud.header.stamp + convention.shift;
  const bool rows_are_rings = !layout.has_ring() && cloud.height > 1 && cloud.height <= kMostRings;
  RelativeTimes relative_time{convention, layout.time(), cloud.header.stamp};
  if (convention.kind == TimeConvention::Kind::kForeignClock)
    relative_time.foreign_start =
        raw_time_to_ns(measure_times(cloud, layout, 0).low, convention.unit_s);

  TimeRange times;
  const std::size_t most = cloud.point_step > 0 ? cloud.data.size() / cloud.point_step : 0;
  scan.points.reserve(most);
  std::uint16_t highest_ring = 0;
  const PositionReader read_position(layout);
  const SlotReader<float, FieldType::kFloat32> read_intensity(layout.intensity());
  const SlotReader<std::uint16_t, FieldType::kUint16> read_ring(layout.ring());
  const SlotReader<std::uint8_t, FieldType::kUint8> read_return(layout.return_index());
  const SlotReader<std::uint8_t, FieldType::kUint8> read_tag(layout.tag());
  for_each_point(cloud, [&](const std::uint8_t* raw, std::size_t row) {
    ScanPoint point;
    if (!read_position(raw, point)) {
      ++result.without_return;
      return;
    }
    if (scan.has_point_times) {
      const TimeNs time = relative_time(raw);
      if (time < -kLongestCloud || time > kLongestCloud) {
        ++result.bad_times;
        return;
      }
      if (!times.add(time)) ++result.backward_times;
      point.t_ns = static_cast<std::uint32_t>(time);
    }
    if (layout.intensity().size > 0) {
      const float intensity = read_intensity(raw);
      point.intensity = std::isfinite(intensity) ? intensity : 0.0F;
    }
    if (layout.has_ring()) point.ring = read_ring(raw);
    if (rows_are_rings) point.ring = static_cast<std::uint16_t>(row);
    if (layout.return_index().size > 0) point.return_index = read_return(raw);
    if (layout.tag().size > 0) point.tag = read_tag(raw);
    highest_ring = std::max(highest_ring, point.ring);
    scan.points.push_back(point);
  });
  if (scan.has_point_times && !scan.points.empty())
    count_from_first(times, cloud.header.stamp, scan);
  if (layout.has_ring()) scan.ring_count = highest_ring + 1;
  if (rows_are_rings) scan.ring_count = static_cast<int>(cloud.height);
  return result;
}

}  // namespace understory
