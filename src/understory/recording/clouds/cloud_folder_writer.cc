#include "understory/recording/clouds/cloud_folder_writer.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "understory/recording/bytes.h"
#include "understory/util/error.h"
#include "understory/util/files/output_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

ByteSpan bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// x y z intensity t ring return_index, packed.
ByteBuffer pack_points(const Scan& scan) {
  ByteBuffer out;
  for (const ScanPoint& point : scan.points) {
    out.put(point.x);
    out.put(point.y);
    out.put(point.z);
    out.put(point.intensity);
    if (scan.has_point_times) out.put(point.t_ns);
    out.put(point.ring);
    out.put(point.return_index);
  }
  return out;
}

void write_file(const std::string& path, const std::string& header, const ByteBuffer& body) {
  OutputFile file(path);
  file.write(bytes_of(header));
  file.write(body.span());
  file.close_unsynced();
}

void write_pcd(const std::string& path, const Scan& scan) {
  const std::string count = std::to_string(scan.points.size());
  const bool timed = scan.has_point_times;
  const std::string header =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity" +
      std::string(timed ? " t" : "") + " ring return_index\nSIZE 4 4 4 4" + (timed ? " 4" : "") +
      " 2 1\nTYPE F F F F" + (timed ? " U" : "") + " U U\nCOUNT 1 1 1 1" + (timed ? " 1" : "") +
      " 1 1\nWIDTH " + count + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count +
      "\nDATA binary\n";
  write_file(path, header, pack_points(scan));
}

void write_ply(const std::string& path, const Scan& scan) {
  const std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                             std::to_string(scan.points.size()) +
                             "\nproperty float x\nproperty float y\nproperty float z\n"
                             "property float intensity\n" +
                             std::string(scan.has_point_times ? "property uint t\n" : "") +
                             "property ushort ring\nproperty uchar return_index\nend_header\n";
  write_file(path, header, pack_points(scan));
}

void write_kitti(const std::string& path, const Scan& scan) {
  ByteBuffer out;
  for (const ScanPoint& point : scan.points) {
    out.put(point.x);
    out.put(point.y);
    out.put(point.z);
    out.put(point.intensity);
  }
  write_file(path, "", out);
}

std::string number(double value, const char* pattern = "%.17g") {
  if (!std::isfinite(value)) return "";
  char text[40];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

std::string imu_row(const ImuSample& sample) {
  std::string row = format_seconds(sample.stamp);
  for (int i = 0; i < 3; ++i)
    row += "," + number(sample.angular_rate[i]);
  for (int i = 0; i < 3; ++i)
    row += "," + number(sample.specific_force[i]);
  return row + "\n";
}

std::string gnss_row(const GnssFix& fix) {
  std::string row = format_seconds(fix.stamp) + "," + number(fix.latitude_deg) + "," +
                    number(fix.longitude_deg) + "," + number(fix.height_m) + "," +
                    number(fix.hdop) + "," + number(fix.vdop) + ",";
  row += fix.satellites >= 0 ? std::to_string(fix.satellites) : "";
  row +=
      "," + std::to_string(fix.quality) + "," + number(fix.track_deg) + "," + number(fix.speed_m_s);
  for (int i = 0; i < 3; ++i)
    row += "," + number(std::sqrt(fix.covariance(i, i)));
  row += "," + number(fix.heading_deg) + "," + number(fix.heading_sd_deg);
  return row + "\n";
}

std::string pose_yaml(const std::string& key, const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond& q = pose.rotation();
  return key + ": {translation_m: [" + number(t.x()) + ", " + number(t.y()) + ", " + number(t.z()) +
         "], rotation_xyzw: [" + number(q.x()) + ", " + number(q.y()) + ", " + number(q.z()) +
         ", " + number(q.w()) + "]}\n";
}

std::string rig_yaml(const Rig& rig) {
  std::string text = "body_frame: " + rig.body_frame + "\n";
  if (!rig.lidar_model.empty()) text += "lidar_model: " + rig.lidar_model + "\n";
  text += pose_yaml("body_from_lidar", rig.body_from_lidar);
  if (rig.body_from_imu) text += pose_yaml("body_from_imu", *rig.body_from_imu);
  if (rig.body_from_gnss) text += pose_yaml("body_from_gnss", *rig.body_from_gnss);
  if (rig.body_from_second_gnss)
    text += pose_yaml("body_from_second_gnss", *rig.body_from_second_gnss);
  return text;
}

}  // namespace

CloudWriter cloud_writer(const std::string& ending) {
  if (ending == ".pcd") return write_pcd;
  if (ending == ".ply") return write_ply;
  if (ending == ".bin") return write_kitti;
  return nullptr;
}

class CloudFolderWriter::Impl {
 public:
  Impl(const std::string& folder, std::string ending, CloudWriter write_cloud)
      : folder_(folder), ending_(std::move(ending)), write_cloud_(std::move(write_cloud)) {
    std::error_code error;
    fs::create_directories(folder_, error);
    if (error) throw OutputError(folder, "cannot be made: " + error.message());
    if (fs::exists(cloud_path(0)) || fs::exists(folder_ / "times.txt"))
      throw OutputError(folder, "holds clouds already");
    times_ = make("times.txt", "");
  }

  void set_rig(const Rig& rig) {
    const auto file = make("extrinsics.yaml", rig_yaml(rig));
    file->close();
  }

  void operator()(const ScanPtr& scan) {
    write_cloud_(cloud_path(scans_++), *scan);
    times_->write(bytes_of(format_seconds(scan->stamp) + "\n"));
  }
  void operator()(const ImuSample& sample) {
    if (!imu_) imu_ = make("imu.csv", "timestamp,gx,gy,gz,ax,ay,az\n");
    imu_->write(bytes_of(imu_row(sample)));
  }
  void operator()(const GnssFix& fix) {
    if (!gnss_)
      gnss_ = make("gnss.csv",
                   "timestamp,latitude_deg,longitude_deg,height_m,hdop,vdop,satellites,quality,"
                   "track_deg,speed_m_s,sd_east_m,sd_north_m,sd_up_m,heading_deg,heading_sd_deg\n");
    gnss_->write(bytes_of(gnss_row(fix)));
  }
  void operator()(const MagSample&) {}

  void finish() {
    for (auto* file : {&times_, &imu_, &gnss_}) {
      if (*file) (*file)->close();
      file->reset();
    }
  }

 private:
  [[nodiscard]] std::string cloud_path(std::size_t number_of_scan) const {
    char name[32];
    std::snprintf(name, sizeof name, "%06zu", number_of_scan);
    return (folder_ / (name + ending_)).string();
  }
  [[nodiscard]] std::unique_ptr<OutputFile> make(const std::string& name,
                                                 const std::string& header) const {
    auto file = std::make_unique<OutputFile>((folder_ / name).string());
    file->write(bytes_of(header));
    return file;
  }

  fs::path folder_;
  std::string ending_;
  CloudWriter write_cloud_;
  std::size_t scans_ = 0;
  std::unique_ptr<OutputFile> times_;
  std::unique_ptr<OutputFile> imu_;
  std::unique_ptr<OutputFile> gnss_;
};

CloudFolderWriter::CloudFolderWriter(const std::string& folder, const std::string& ending,
                                     CloudWriter write_cloud)
    : impl_(std::make_unique<Impl>(folder, ending, std::move(write_cloud))) {}
CloudFolderWriter::~CloudFolderWriter() = default;

void CloudFolderWriter::set_rig(const Rig& rig) {
  impl_->set_rig(rig);
}
void CloudFolderWriter::write(const Event& event) {
  std::visit(*impl_, event);
}
void CloudFolderWriter::finish() {
  impl_->finish();
}

}  // namespace understory
