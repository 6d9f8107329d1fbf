#include "understory/recording/clouds/stems_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr double kMaxRangeM = 10'000.0;  // no sensor sees a stem from farther away

enum Column {
  kFrame,
  kTime,
  kX,
  kY,
  kZ,
  kAxisX,
  kAxisY,
  kAxisZ,
  kLength,
  kDbh,
  kScore,
  kRadius,
  kRadiusSd,
  kXx,
  kXy,
  kYy,
  kZz,
  kColumns
};
constexpr std::array<std::string_view, kColumns> kNames = {
    "frame", "timestamp", "x",        "y",           "z",  "axis_x", "axis_y", "axis_z", "length_m",
    "dbh_m", "score",     "radius_m", "radius_sd_m", "xx", "xy",     "yy",     "zz"};

// The table, its columns found once.
class StemTable {
 public:
  StemTable(const std::filesystem::path& path, Log& log)
      : table_(path, {"frame", "x", "y", "z"}, {.exact_width = true}) {
    for (std::size_t column = 0; column < kColumns; ++column)
      cell_[column] = table_.find({std::string(kNames[column])});
    std::string unknown;
    for (const std::string& name : table_.names()) {
      if (std::find(kNames.begin(), kNames.end(), name) == kNames.end())
        unknown += (unknown.empty() ? "" : ", ") + name.substr(0, 40);
    }
    if (!unknown.empty()) log.info("stems: unknown columns passed over: " + unknown);
  }

  [[nodiscard]] bool next() { return table_.next(); }
  [[noreturn]] void fail(const std::string& expected) const { table_.fail(expected); }

  // Empty where the column is absent.
  [[nodiscard]] std::string_view text(Column column) const {
    return cell_[column] ? table_.text(*cell_[column]) : std::string_view();
  }
  // NaN where the cell is empty or the column absent.
  [[nodiscard]] double number(Column column) const {
    return cell_[column] ? table_.number(*cell_[column]) : std::numeric_limits<double>::quiet_NaN();
  }

  // NaN where unknown.
  [[nodiscard]] float finite(Column column) const {
    const double value = number(column);
    if (std::isinf(value))
      fail("expected a finite number in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  // Of a tree or its error, NaN where unknown.
  [[nodiscard]] float size(Column column) const {
    constexpr double kTallest = 200.0;
    const double value = number(column);
    if (value < 0.0 || value > kTallest)
      fail("expected 0 to 200 m in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  // NaN where unknown.
  [[nodiscard]] float variance(Column column) const {
    const double value = number(column);
    if (value <= 0.0 || std::isinf(value))
      fail("expected a variance above 0 in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  [[nodiscard]] float position(Column column) const {
    const double value = number(column);
    if (!(std::abs(value) < kMaxRangeM))
      fail("expected a position within 10 km of the sensor in column '" +
           std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

 private:
  CsvReader table_;
  std::array<std::optional<std::size_t>, kColumns> cell_;
};

int frame_of(const StemTable& table) {
  const std::string_view text = table.text(kFrame);
  int frame = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), frame);
  if (error != std::errc() || end != text.data() + text.size() || frame < 0)
    table.fail("expected a frame number (0, 1, ...) in column 'frame'");
  return frame;
}

TimeNs stamp_of(const StemTable& table, int frame) {
  const std::string text(table.text(kTime));
  TimeNs stamp = static_cast<TimeNs>(frame) * kNsPerSecond;
  if (text.empty() || parse_seconds(text, stamp)) return stamp;
  const std::optional<double> seconds = to_number(text);  // 1.7e3
  if (!seconds || !(std::abs(*seconds) < 9e9)) table.fail("expected a time in column 'timestamp'");
  return from_seconds(*seconds);
}

Eigen::Vector3f axis_of(const StemTable& table) {
  const Eigen::Vector3d axis(table.number(kAxisX), table.number(kAxisY), table.number(kAxisZ));
  if (axis.array().isNaN().all()) return Eigen::Vector3f::Constant(Stem::kUnknown);
  const double length = axis.norm();
  if (!(length > 0.1 && length < 10.0)) table.fail("expected a direction in axis_x,axis_y,axis_z");
  return (axis / length).cast<float>();
}

Stem stem_of(const StemTable& table) {
  Stem stem;
  stem.point = {table.position(kX), table.position(kY), table.position(kZ)};
  stem.axis = axis_of(table);
  stem.length_m = table.size(kLength);
  stem.dbh_m = table.size(kDbh);
  stem.score = table.finite(kScore);
  stem.radius_m = table.size(kRadius);
  stem.radius_sd_m = table.size(kRadiusSd);
  stem.xx = table.variance(kXx);
  stem.xy = table.finite(kXy);
  stem.yy = table.variance(kYy);
  stem.zz = table.variance(kZz);
  return stem;
}

}  // namespace

std::vector<StemView> read_stem_views(const std::filesystem::path& path, Log& log) {
  StemTable table(path, log);
  std::vector<StemView> views;
  while (table.next()) {
    const int frame = frame_of(table);
    const TimeNs stamp = stamp_of(table, frame);
    if (views.empty() || views.back().frame != frame) {
      if (!views.empty() && frame < views.back().frame)
        table.fail("expected the rows of a frame together and frames in ascending order");
      if (!views.empty() && stamp <= views.back().stamp)
        table.fail("expected a timestamp that grows from frame to frame");
      if (!views.empty()) views.back().stems.shrink_to_fit();
      views.push_back({frame, stamp, {}});
    } else if (stamp != views.back().stamp) {
      table.fail("expected one timestamp for all rows of a frame");
    }
    views.back().stems.push_back(stem_of(table));
  }
  if (views.empty()) table.fail("expected at least one row with a stem");
  return views;
}

}  // namespace understory
