#include "understory/output/clouds/las_stream.h"

#include <cerrno>
#include <cstring>
#include <istream>
#include <limits>
#include <ostream>
#include <string>
#include <utility>

#include <laszip/laszip_api.h>

#include "understory/util/error.h"

namespace understory {
namespace {

// Of tree_id and HeightAboveGround.
constexpr laszip_U16 kColumnBytes = sizeof(std::uint32_t) + sizeof(float);

}  // namespace

struct LasStream::Impl {
  std::ostream& stream;
  std::string file;
  bool trees = false;
  laszip_POINTER las = nullptr;
  laszip_header* header = nullptr;
  laszip_point* point = nullptr;
  bool open = false;

  Impl(std::ostream& to, std::string name) : stream(to), file(std::move(name)) {}
  ~Impl() {
    if (las == nullptr) return;
    if (open) laszip_close_writer(las);
    laszip_destroy(las);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[noreturn]] void fail() const {
    const int code = errno;
    std::string reason = code != 0 ? std::strerror(code) : "";
    laszip_CHAR* told = nullptr;
    if (reason.empty() && las != nullptr && laszip_get_error(las, &told) == 0 && told != nullptr) {
      reason = told;
    }
    throw OutputError(file, "cannot be written: " + reason);
  }
  void check(laszip_I32 code) const {
    if (code != 0 || !stream.good()) fail();
  }

  void fill_header(const LasOptions& options) {
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
    std::strncpy(header->system_identifier, "understory SLAM", 31);
    if (trees) add_columns();
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
};

LasStream::LasStream(std::ostream& stream, std::string file, const LasOptions& options,
                     const Form& form)
    : impl_(std::make_unique<Impl>(stream, std::move(file))) {
  Impl& self = *impl_;
  self.trees = options.trees;
  errno = 0;
  if (laszip_create(&self.las) != 0) throw InternalError("LASzip cannot be started");
  self.check(laszip_request_native_extension(self.las, 1));
  // Chunks of variable size end where the user of LASzip says so: here with the file.
  if (form.one_chunk)
    self.check(laszip_set_chunk_size(self.las, std::numeric_limits<laszip_U32>::max()));
  self.check(laszip_get_header_pointer(self.las, &self.header));
  self.fill_header(options);
  self.check(laszip_get_point_pointer(self.las, &self.point));
  self.check(laszip_open_writer_stream(self.las, stream, form.compressed ? 1 : 0, 0));
  self.open = true;
}

LasStream::~LasStream() = default;

void LasStream::add(const LasPointSteps& point) {
  Impl& self = *impl_;
  laszip_point& out = *self.point;
  out.X = point.x;
  out.Y = point.y;
  out.Z = point.z;
  out.gps_time = point.gps_time;
  out.intensity = point.intensity;
  out.return_number = 1;
  out.number_of_returns = 1;
  out.extended_return_number = 1;
  out.extended_number_of_returns = 1;
  out.extended_classification = point.classification;
  out.classification = point.classification < 32 ? point.classification : 0;
  if (self.trees) {
    UNDERSTORY_CHECK(out.num_extra_bytes == kColumnBytes);
    std::memcpy(out.extra_bytes, &point.tree_id, sizeof point.tree_id);
    std::memcpy(out.extra_bytes + sizeof point.tree_id, &point.height_above_ground,
                sizeof point.height_above_ground);
  }
  errno = 0;
  self.check(laszip_write_point(self.las));
  self.check(laszip_update_inventory(self.las));
}

void LasStream::close() {
  Impl& self = *impl_;
  errno = 0;
  self.open = false;
  self.check(laszip_close_writer(self.las));
}

}  // namespace understory
