#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/imu_sample.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/csv.h"
#include "understory/util/log.h"

namespace understory {

// The rows of imu.csv or gnss.csv. Rows that cannot be read are passed over with a warning
// ("recording.damaged_line"). Not thread-safe.
class EventRows {
 public:
  EventRows(const std::filesystem::path& path, Log& log);

  // Column names in lower case; several names for one column may be given. Throws InputError if
  // none of them is there.
  [[nodiscard]] std::size_t require(const std::vector<std::string>& names) const {
    return table_.require(names);
  }
  [[nodiscard]] std::optional<std::size_t> find(const std::vector<std::string>& names) const {
    return table_.find(names);
  }
  // The next row with as many cells as there are columns; false at the end.
  [[nodiscard]] bool next() { return table_.next(); }
  // NaN where the cell is empty or no number.
  [[nodiscard]] double number(std::size_t column) const;
  // Nanoseconds where the column's name ends with _ns or the number is whole and beyond 1e11, else
  // seconds.
  [[nodiscard]] std::optional<TimeNs> time(std::size_t column) const;
  void damaged(const std::string& what);
  // Rows passed over so far.
  [[nodiscard]] std::uint64_t unreadable() const { return unreadable_; }
  // Which rows have been read, and back to there.
  void save(BinaryWriter& writer) const {
    table_.save(writer);
    writer.put(unreadable_);
  }
  void load(BinaryReader& reader) {
    table_.load(reader);
    unreadable_ = reader.get<std::uint64_t>();
  }

 private:
  Log& log_;
  std::uint64_t unreadable_ = 0;
  CsvReader table_;
};

// imu.csv: timestamp, gx, gy, gz (rad/s), ax, ay, az (m/s², +9.81 up at rest).
class CsvImuReader {
 public:
  CsvImuReader(const std::filesystem::path& path, Log& log);
  [[nodiscard]] std::optional<ImuSample> next();
  [[nodiscard]] std::uint64_t unreadable() const { return rows_.unreadable(); }
  void save(BinaryWriter& writer) const { rows_.save(writer); }
  void load(BinaryReader& reader) { rows_.load(reader); }

 private:
  EventRows rows_;
  std::size_t time_ = 0;
  std::size_t rate_[3]{};
  std::size_t force_[3]{};
};

// gnss.csv: timestamp, latitude_deg, longitude_deg, height_m (above the ellipsoid), and where known
// hdop, vdop, satellites, quality, track_deg, speed_m_s, sd_east_m, sd_north_m, sd_up_m,
// heading_deg, heading_sd_deg.
class CsvGnssReader {
 public:
  CsvGnssReader(const std::filesystem::path& path, Log& log);
  [[nodiscard]] std::optional<GnssFix> next();
  [[nodiscard]] std::uint64_t unreadable() const { return rows_.unreadable(); }
  void save(BinaryWriter& writer) const { rows_.save(writer); }
  void load(BinaryReader& reader) { rows_.load(reader); }

 private:
  [[nodiscard]] double optional_number(const std::optional<std::size_t>& column) const;

  EventRows rows_;
  std::size_t time_ = 0, latitude_ = 0, longitude_ = 0, height_ = 0;
  std::optional<std::size_t> hdop_, vdop_, satellites_, quality_, track_, speed_, heading_,
      heading_sd_;
  std::optional<std::size_t> sd_[3];
};

}  // namespace understory
