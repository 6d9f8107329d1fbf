#include "understory/recording/clouds/cloud_folder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>

#include "understory/recording/captures/nmea.h"
#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/clouds/cloud_times.h"
#include "understory/recording/clouds/csv_events.h"
#include "understory/recording/clouds/las.h"
#include "understory/recording/extrinsics.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/recording/messages/topic_statistics.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCloudsToJudge = 4;  // by which the times of the points are understood
constexpr float kFarFromSensor = 2e4F;

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

bool has_cloud_name(const fs::path& path) {
  static constexpr std::array<const char*, 5> kExtensions{".pcd", ".ply", ".las", ".laz", ".bin"};
  const std::string extension = extension_of(path);
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

// The clouds of a folder in order, of the most frequent kind: a stray map.las among the scans is no
// scan.
std::vector<std::string> cloud_names(const fs::path& folder, Log& log) {
  std::map<std::string, std::vector<std::string>> by_kind;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (has_cloud_name(entry->path()) && entry->is_regular_file(ignored))
      by_kind[extension_of(entry->path())].push_back(entry->path().filename().string());
  }
  if (error) throw InputError(folder.string(), "", error.message());
  const auto most = std::max_element(
      by_kind.begin(), by_kind.end(),
      [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  if (most == by_kind.end())
    throw InputError(folder.string(), "", "expected clouds (.pcd, .ply, .las, .laz, .bin)");
  for (const auto& [kind, names] : by_kind) {
    if (kind == most->first) continue;
    log.warn("recording.other_clouds",
             folder.string() + ": " + std::to_string(names.size()) + " " + kind + " files beside " +
                 std::to_string(most->second.size()) + " " + most->first + " files are left out");
  }
  std::vector<std::string> names = most->second;
  std::sort(names.begin(), names.end(), natural_less);
  return names;
}

CloudTable las_table(ByteSource& file, Log& log) {
  const LasHeader header = read_las_header(file);
  CloudTable table;
  table.format = header.compressed ? "LAZ" : "LAS";
  for (const char* name : {"x", "y", "z"})
    table.add_field(name, FieldType::kFloat64);
  table.add_field("intensity", FieldType::kFloat32);
  if (header.has_gps_time) table.add_field("gps_time", FieldType::kFloat64);
  read_las_points(file, header, log, [&](const LasPoint& point) {
    const std::size_t begin = table.data.size();
    table.data.resize(begin + table.point_step);
    std::uint8_t* raw = table.data.data() + begin;
    std::memcpy(raw, point.position.data(), 24);
    std::memcpy(raw + 24, &point.intensity, 4);
    if (header.has_gps_time) std::memcpy(raw + 28, &point.gps_time, 8);
  });
  table.width = static_cast<std::uint32_t>(table.size());
  return table;
}

CloudTable read_table(const std::string& path, Log& log) {
  const auto file = open_file(path);
  switch (cloud_format(*file)) {
    case CloudFormat::kLas:
      return las_table(*file, log);
    case CloudFormat::kPcd:
      return read_pcd(*file, log);
    case CloudFormat::kPly:
      return read_ply(*file, log);
    case CloudFormat::kKitti:
      return read_kitti(*file, log);
    case CloudFormat::kE57:
      throw InputError(
          path, "",
          "an E57 file holds a finished map and no times. For trees in it: understory inventory");
    case CloudFormat::kUnknown:
      break;
  }
  throw InputError(path, "byte 0", "expected a cloud (.pcd, .ply, .las, .laz, .bin)");
}

// Side streams and clouds of a folder, merged by time.
class CloudFolder : public Recording {
 public:
  CloudFolder(const fs::path& folder, std::vector<std::string> names, bool single,
              const OpenOptions& options, Log& log)
      : folder_(folder), names_(std::move(names)), single_(single), log_(log) {
    take_times(options);
    judge_clouds();
    if (!single_) open_side_streams();
    make_rig(options);
  }

  std::optional<Event> next() override {
    if (!scan_) scan_ = next_scan();
    if (!imu_head_ && imu_) imu_head_ = imu_->next();
    if (!fix_head_) fix_head_ = next_fix();
    constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
    const TimeNs scan_time = scan_ ? scan_->end() : kNever;
    const TimeNs imu_time = imu_head_ ? imu_head_->stamp : kNever;
    const TimeNs fix_time = fix_head_ ? fix_head_->stamp : kNever;
    if (imu_head_ && imu_time <= scan_time && imu_time <= fix_time) {
      imu_statistics_.add_stamp(imu_time);
      return take(imu_head_);
    }
    if (fix_head_ && fix_time <= scan_time) {
      fix_statistics_.add_stamp(fix_time);
      return take(fix_head_);
    }
    if (!scan_) return std::nullopt;
    lidar_.add_stamp(scan_->stamp);
    lidar_.report().points += scan_->points.size();
    Event event = std::move(scan_);
    scan_ = nullptr;
    return event;
  }

  bool save(BinaryWriter& writer) const override {
    writer.put(static_cast<std::uint64_t>(next_cloud_));
    writer.put(scan_ != nullptr);  // the cloud before the next one waits
    writer.put(any_scan_);
    for (const TopicStatistics* each : {&lidar_, &imu_statistics_, &fix_statistics_})
      each->save(writer);
    if (imu_) imu_->save(writer);
    if (fixes_) fixes_->save(writer);
    if (nmea_) nmea_->save(writer);
    writer.put(imu_head_.has_value());
    if (imu_head_) put_imu(writer, *imu_head_);
    writer.put(fix_head_.has_value());
    if (fix_head_) put_fix(writer, *fix_head_);
    return true;
  }
  void load(BinaryReader& reader) override {
    next_cloud_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
    const bool waits = reader.get<bool>();
    if (next_cloud_ > names_.size() || (waits && next_cloud_ == 0))
      throw InputError(folder_.string(), "", "holds fewer clouds than when the run was begun");
    if (waits) scan_ = read_scan(next_cloud_ - 1);
    any_scan_ = reader.get<bool>();
    for (TopicStatistics* each : {&lidar_, &imu_statistics_, &fix_statistics_})
      each->load(reader);
    if (imu_) imu_->load(reader);
    if (fixes_) fixes_->load(reader);
    if (nmea_) nmea_->load(reader);
    if (reader.get<bool>()) imu_head_ = get_imu(reader);
    if (reader.get<bool>()) fix_head_ = get_fix(reader);
  }

  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports{lidar_.report()};
    if (imu_) {
      reports.push_back(imu_statistics_.report());
      reports.back().unreadable = imu_->unreadable();
    }
    if (fixes_ || nmea_) reports.push_back(fix_statistics_.report());
    if (fixes_) reports.back().unreadable = fixes_->unreadable();
    return reports;
  }
  std::string format() const override {
    return (single_ ? "one cloud (" : "folder of clouds (") + cloud_format_ + ")";
  }
  double progress() const override {
    return static_cast<double>(next_cloud_) / static_cast<double>(names_.size());
  }

 private:
  template <typename T>
  static Event take(std::optional<T>& head) {
    Event event = *head;
    head.reset();
    return event;
  }

  void take_times(const OpenOptions& options) {
    Log quiet;  // one cloud needs no rate
    times_ = cloud_file_times(folder_.string(), names_, options.rate_hz, single_ ? quiet : log_);
    if (times_.source == "file names") sort_by_time();
    names_.resize(times_.stamps.size());
    if (names_.empty()) throw InputError(folder_.string(), "times.txt", "expected times");
  }

  // Names may order fractions of seconds wrongly (10.25 behind 10.5).
  void sort_by_time() {
    std::vector<std::size_t> order(names_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    sort_stably(order,
                [&](std::size_t a, std::size_t b) { return times_.stamps[a] < times_.stamps[b]; });
    std::vector<std::string> names;
    std::vector<TimeNs> stamps;
    for (const std::size_t i : order) {
      names.push_back(names_[i]);
      stamps.push_back(times_.stamps[i]);
    }
    names_ = std::move(names);
    times_.stamps = std::move(stamps);
  }

  [[nodiscard]] std::string path(std::size_t i) const { return (folder_ / names_[i]).string(); }

  // Understands the times of the points by the first clouds that can be read.
  void judge_clouds() {
    Log quiet;  // damage is told when it is read
    std::vector<CloudTimes> clouds;
    std::string field;
    std::string type;
    std::string trouble;
    bool any = false;
    for (std::size_t i = 0; i < names_.size() && clouds.size() < kCloudsToJudge; ++i) {
      try {
        const CloudTable table = read_table(path(i), quiet);
        const PointCloud2Message message = table.message(times_.stamps[i]);
        const auto layout = CloudLayout::find(message);
        if (!layout) throw InputError(path(i), "header", "expected the fields x, y and z");
        clouds.push_back(measure_times(message, *layout, times_.stamps[i]));
        if (!any) cloud_format_ = table.format;
        any = true;
        field = layout->time_field();
        type = layout->time_type();
      } catch (const ReadError&) {
        throw;
      } catch (const InputError& error) {
        if (trouble.empty()) trouble = error.what();
      }
    }
    if (!any) throw InputError(folder_.string(), "", "no cloud can be read: " + trouble);
    convention_ = detect_point_times(field, type, clouds, {});
    if (!convention_.warning.empty() && !single_)
      log_.warn("recording.point_times", folder_.string() + ": " + convention_.warning);
    TopicReport report;
    report.name = single_ ? names_.front() : "clouds";
    report.type = cloud_format_;
    report.role = "lidar";
    report.conventions = "times of the clouds: " + times_.source + "; " + convention_.text;
    lidar_ = TopicStatistics(report);
  }

  void open_side_streams() {
    std::error_code error;
    const fs::path imu = folder_ / "imu.csv";
    if (fs::is_regular_file(imu, error)) {
      imu_ = std::make_unique<CsvImuReader>(imu, log_);
      imu_statistics_ = side_report("imu.csv", "csv", "imu", "rad/s, m/s²; with gravity");
    }
    const fs::path fixes = folder_ / "gnss.csv";
    if (fs::is_regular_file(fixes, error)) {
      fixes_ = std::make_unique<CsvGnssReader>(fixes, log_);
      fix_statistics_ = side_report("gnss.csv", "csv", "gnss", "WGS 84, ellipsoidal height");
      return;
    }
    std::vector<fs::path> logs;
    for (const auto& entry : fs::directory_iterator(folder_, error)) {
      if (extension_of(entry.path()) == ".nmea") logs.push_back(entry.path());
    }
    if (logs.empty()) return;
    std::sort(logs.begin(), logs.end());
    if (logs.size() > 1) {
      log_.warn("recording.nmea",
                folder_.string() + ": of several NMEA logs only " + logs[0].string() + " is read");
    }
    std::ifstream ahead(logs[0], std::ios::binary);
    const std::int64_t day = first_nmea_day(ahead, logs[0].string());
    nmea_stream_.open(logs[0], std::ios::binary);
    nmea_ = std::make_unique<NmeaLogReader>(nmea_stream_, logs[0].string(), day, log_);
    fix_statistics_ = side_report(logs[0].filename().string(), "NMEA 0183", "gnss", "UTC");
  }

  static TopicStatistics side_report(const std::string& name, const std::string& type,
                                     const std::string& role, const std::string& conventions) {
    TopicReport report;
    report.name = name;
    report.type = type;
    report.role = role;
    report.conventions = conventions;
    report.beside = role == "gnss";
    return TopicStatistics(report);
  }

  void make_rig(const OpenOptions& options) {
    if (options.lidar_entry > 0)
      throw ConfigError({folder_.string() + ": a folder of clouds holds one lidar: expected one"});
    rig_.lidar_extrinsic_source = "is the body";
    if (imu_) {
      rig_.body_frame = "imu";
      rig_.body_from_imu = Pose();
      rig_.lidar_extrinsic_source = rig_.imu_extrinsic_source = "assumed identity";
    }
    if (!options.extrinsics_file.empty()) {
      apply_extrinsics_file(options.extrinsics_file, {}, rig_, log_, options.lidar_entry);
    }
    // The file may place the one on the other, or both on a body of its own.
    const bool lidar = rig_.lidar_extrinsic_source.rfind("extrinsics file", 0) == 0;
    const bool imu = rig_.imu_extrinsic_source.rfind("extrinsics file", 0) == 0;
    const bool known = (lidar && imu) || (rig_.body_frame == "imu" && (lidar || imu));
    if (imu_ && !known) {
      log_.warn("recording.no_imu_extrinsics",
                folder_.string() +
                    ": the IMU is taken to sit in the lidar's frame: give "
                    "--extrinsics FILE");
    }
  }

  std::optional<GnssFix> next_fix() {
    if (fixes_) return fixes_->next();
    return nmea_ ? nmea_->next() : std::nullopt;
  }

  // The next cloud that can be read; it may hold no point, as a scan of a recording may.
  ScanPtr next_scan() {
    while (next_cloud_ < names_.size()) {
      const std::size_t i = next_cloud_++;
      try {
        ScanPtr scan = read_scan(i);
        any_scan_ |= !scan->points.empty();
        return scan;
      } catch (const ReadError&) {
        throw;
      } catch (const InputError& error) {
        report_finding(log_, Finding::kDamage, error.what());
      }
    }
    if (!any_scan_) throw InputError(folder_.string(), "", "no cloud holds a point");
    return nullptr;
  }

  ScanPtr read_scan(std::size_t i) {
    const CloudTable table = read_table(path(i), log_);
    const PointCloud2Message message = table.message(times_.stamps[i]);
    const auto layout = CloudLayout::find(message);
    if (!layout) throw InputError(path(i), "header", "expected the fields x, y and z");
    ConvertedCloud converted = convert_cloud(message, *layout, convention_);
    lidar_.report().empty_points += converted.without_return;
    if (converted.bad_times > 0) {
      report_finding(log_, Finding::kDamage,
                     path(i) + ": " + std::to_string(converted.bad_times) +
                         " points with times outside of the scan, left out");
    }
    if (!converted.scan->points.empty() && std::abs(converted.scan->points[0].x) > kFarFromSensor) {
      log_.warn("recording.far_cloud",
                path(i) +
                    ": its points lie kilometres from the origin, as in a coordinate system, "
                    "and lose precision: scans are expected in the sensor's frame");
    }
    if (converted.scan->points.empty()) {
      log_.warn("recording.empty_cloud", path(i) + ": holds no point");
    }
    return converted.scan;
  }

  fs::path folder_;
  std::vector<std::string> names_;
  bool single_;
  Log& log_;
  CloudFileTimes times_;
  TimeConvention convention_;
  std::string cloud_format_;
  Rig rig_;
  std::size_t next_cloud_ = 0;
  bool any_scan_ = false;
  ScanPtr scan_;
  std::unique_ptr<CsvImuReader> imu_;
  std::optional<ImuSample> imu_head_;
  std::unique_ptr<CsvGnssReader> fixes_;
  std::ifstream nmea_stream_;
  std::unique_ptr<NmeaLogReader> nmea_;
  std::optional<GnssFix> fix_head_;
  TopicStatistics lidar_;
  TopicStatistics imu_statistics_;
  TopicStatistics fix_statistics_;
};

}  // namespace

bool is_cloud_folder(const std::string& path) {
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    if (has_cloud_name(entry->path())) return true;
  }
  return false;
}

bool is_cloud_file(const std::string& path) {
  try {
    const auto file = open_file(path);
    return cloud_format(*file) != CloudFormat::kUnknown;
  } catch (const ReadError&) {
    throw;
  } catch (const InputError&) {
    return false;
  }
}

std::unique_ptr<Recording> open_cloud_folder(const std::string& path, const OpenOptions& options,
                                             Log& log) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    return std::make_unique<CloudFolder>(path, cloud_names(path, log), false, options, log);
  }
  const fs::path file(path);
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  return std::make_unique<CloudFolder>(folder, std::vector<std::string>{file.filename().string()},
                                       true, options, log);
}

}  // namespace understory
