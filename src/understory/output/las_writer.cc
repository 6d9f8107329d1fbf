#include "understory/output/las_writer.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <istream>
#include <limits>
#include <ostream>
#include <system_error>

#include <laszip/laszip_api.h>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

constexpr TimeNs kUnixAtGpsEpoch = 315'964'800 * kNsPerSecond;
constexpr TimeNs kAdjustedGps = 1'000'000'000 * kNsPerSecond;
// Of tree_id and HeightAboveGround.
constexpr laszip_U16 kColumnBytes = sizeof(std::uint32_t) + sizeof(float);
// Of the offset, in steps of the scale.
constexpr double kMostSteps = 2147483647.0;
constexpr TimeNs kYear2000 = 946'684'800 * kNsPerSecond;

// Seconds by which GPS time is ahead of UTC; the leap seconds since 1999.
TimeNs gps_ahead_of_utc(TimeNs unix_time) {
  struct Leap {
    TimeNs since_s;
    TimeNs ahead_s;
  };
  constexpr std::array<Leap, 5> kLeaps = {{{1'483'228'800, 18},
                                           {1'435'708'800, 17},
                                           {1'341'100'800, 16},
                                           {1'230'768'000, 15},
                                           {1'136'073'600, 14}}};
  for (const Leap& leap : kLeaps) {
    if (unix_time >= leap.since_s * kNsPerSecond) return leap.ahead_s * kNsPerSecond;
  }
  return 13 * kNsPerSecond;
}

double las_time(TimeNs stamp) {
  if (stamp < kYear2000) return to_seconds(stamp);
  return to_seconds(stamp + gps_ahead_of_utc(stamp) - kUnixAtGpsEpoch - kAdjustedGps);
}

}  // namespace

bool has_room(const LasOptions& options, const Eigen::Vector3d& point) {
  return ((point - options.offset).cwiseQuotient(options.scale).array().abs() < kMostSteps).all();
}

struct LasWriter::Impl {
  std::filesystem::path path;
  LasOptions options;
  std::ofstream stream;
  laszip_POINTER las = nullptr;
  laszip_header* header = nullptr;
  laszip_point* point = nullptr;
  std::uint64_t count = 0;
  bool open = false;
  bool committed = false;

  [[noreturn]] void fail() const {
    const int code = errno;
    std::string reason = code != 0 ? std::strerror(code) : "";
    laszip_CHAR* told = nullptr;
    if (reason.empty() && las != nullptr && laszip_get_error(las, &told) == 0 && told != nullptr) {
      reason = told;
    }
    throw OutputError(path.string(), "cannot be written: " + reason);
  }
  void check(laszip_I32 code) const {
    if (code != 0 || !stream.good()) fail();
  }
  ~Impl() {
    if (las != nullptr) {
      if (open) laszip_close_writer(las);
      laszip_destroy(las);
    }
    stream.close();
    if (committed) return;
    std::error_code ignored;
    std::filesystem::remove(part_path(path), ignored);
  }

  void fill_header() {
    header->version_major = 1;
    header->version_minor = 4;
    header->header_size = 375;
    header->offset_to_point_data = 375;
    header->point_data_format = 6;
    header->point_data_record_length = 30;
    header->x_scale_factor = options.scale.x();
    header->y_scale_factor = options.scale.y();
    header->z_scale_factor = options.scale.z();
    header->x_offset = options.offset.x();
    header->y_offset = options.offset.y();
    header->z_offset = options.offset.z();
    constexpr laszip_U16 kStandardGpsTime = 1;
    constexpr laszip_U16 kWkt = 16;
    header->global_encoding = (options.gps_week_time ? 0 : kStandardGpsTime) | kWkt;
    std::strncpy(header->generating_software, options.generating_software.c_str(), 31);
    std::strncpy(header->system_identifier, "SLAM", 31);
    if (options.trees) add_columns();
    if (options.crs_wkt.empty()) return;
    check(laszip_add_vlr(
        las, "LASF_Projection", 2112, static_cast<laszip_U16>(options.crs_wkt.size() + 1),
        "OGC coordinate system WKT", reinterpret_cast<const laszip_U8*>(options.crs_wkt.c_str())));
  }

  // LASzip's numbers of the types.
  void add_columns() {
    constexpr laszip_U32 kUnsigned32 = 4;
    constexpr laszip_U32 kFloat32 = 8;
    header->point_data_record_length += kColumnBytes;
    check(laszip_add_attribute(las, kUnsigned32, "tree_id", "0: of no tree", 1.0, 0.0));
    check(laszip_add_attribute(las, kFloat32, "HeightAboveGround", "metres", 1.0, 0.0));
  }

  [[nodiscard]] laszip_I32 scaled(double value, int axis) const {
    const double offset = options.offset[axis];
    const double scale = options.scale[axis];
    const double steps = std::round((value - offset) / scale);
    if (!(std::abs(steps) < kMostSteps)) {
      throw OutputError(path.string(),
                        fmt::format("coordinate {} m does not fit: expected one within {:.0f} km "
                                    "of the offset {} m",
                                    value, 2147483.647 * scale, offset));
    }
    return static_cast<laszip_I32>(steps);
  }
};

LasWriter::LasWriter(const std::filesystem::path& path, const LasOptions& options)
    : impl_(std::make_unique<Impl>()) {
  Impl& self = *impl_;
  self.path = path;
  self.options = options;
  errno = 0;
  self.stream.open(part_path(path), std::ios::binary | std::ios::trunc);
  if (!self.stream) self.fail();
  if (laszip_create(&self.las) != 0) throw InternalError("LASzip cannot be started");
  self.check(laszip_request_native_extension(self.las, 1));
  self.check(laszip_get_header_pointer(self.las, &self.header));
  self.fill_header();
  self.check(laszip_get_point_pointer(self.las, &self.point));
  const bool compressed = path.extension() == ".laz";
  self.check(laszip_open_writer_stream(self.las, self.stream, compressed ? 1 : 0, 0));
  self.open = true;
}

LasWriter::~LasWriter() = default;

std::uint64_t LasWriter::points() const {
  return impl_->count;
}

void LasWriter::add(const LasRecord& point) {
  Impl& self = *impl_;
  laszip_point& out = *self.point;
  out.X = self.scaled(point.x, 0);
  out.Y = self.scaled(point.y, 1);
  out.Z = self.scaled(point.z, 2);
  out.gps_time = point.gps_time.value_or(las_time(point.stamp));
  out.intensity = point.intensity;
  out.return_number = 1;
  out.number_of_returns = 1;
  out.extended_return_number = 1;
  out.extended_number_of_returns = 1;
  out.extended_classification = point.classification;
  out.classification = point.classification < 32 ? point.classification : 0;
  if (self.options.trees) {
    UNDERSTORY_CHECK(out.num_extra_bytes == kColumnBytes);
    std::memcpy(out.extra_bytes, &point.tree_id, sizeof point.tree_id);
    std::memcpy(out.extra_bytes + sizeof point.tree_id, &point.height_above_ground,
                sizeof point.height_above_ground);
  }
  errno = 0;
  self.check(laszip_write_point(self.las));
  self.check(laszip_update_inventory(self.las));
  ++self.count;
}

void LasWriter::commit() {
  Impl& self = *impl_;
  errno = 0;
  self.open = false;
  self.check(laszip_close_writer(self.las));
  self.stream.close();
  if (!self.stream) self.fail();
  sync_and_rename(part_path(self.path), self.path);
  self.committed = true;
}

}  // namespace understory
