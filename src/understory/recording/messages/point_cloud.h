#pragma once

#include <memory>
#include <optional>
#include <string>

#include "understory/recording/messages/message_decode.h"
#include "understory/recording/point_times.h"
#include "understory/sensor/scan.h"

namespace understory {

// Where a cloud's points keep what; found by the fields' names, whatever their types and order.
class CloudLayout {
 public:
  // Nothing if there are no readable x, y and z.
  [[nodiscard]] static std::optional<CloudLayout> find(const PointCloud2Message& cloud);

  [[nodiscard]] const std::string& time_field() const { return time_name_; }  // empty: none
  [[nodiscard]] std::string time_type() const;                                // "uint32"
  [[nodiscard]] bool has_ring() const { return ring_.size > 0; }

  struct Slot {
    std::uint32_t offset = 0;
    std::uint32_t size = 0;  // 0: no such field
    FieldType type = FieldType::kFloat32;
    bool swap = false;
    [[nodiscard]] double read(const std::uint8_t* point) const;
  };
  [[nodiscard]] const Slot& x() const { return x_; }
  [[nodiscard]] const Slot& y() const { return y_; }
  [[nodiscard]] const Slot& z() const { return z_; }
  [[nodiscard]] const Slot& intensity() const { return intensity_; }
  [[nodiscard]] const Slot& ring() const { return ring_; }
  [[nodiscard]] const Slot& time() const { return time_; }
  [[nodiscard]] const Slot& return_index() const { return return_index_; }
  [[nodiscard]] const Slot& tag() const { return tag_; }  // of Livox

 private:
  Slot x_, y_, z_, intensity_, ring_, time_, return_index_, tag_;
  std::string time_name_;
};

// The range of raw times over the points that are returns.
[[nodiscard]] CloudTimes measure_times(const PointCloud2Message& cloud, const CloudLayout& layout,
                                       TimeNs log_time);

// The highest ring number of the points; -1 where they have none.
[[nodiscard]] int highest_ring(const PointCloud2Message& cloud, const CloudLayout& layout);

// A scan made of a message, and how many of its points were dropped.
struct ConvertedCloud {
  std::shared_ptr<Scan> scan;
  std::size_t without_return = 0;  // NaN or range zero: dropped
  std::size_t bad_times = 0;       // times far outside of the scan: dropped
  std::size_t backward_times = 0;  // earlier than the point before them: kept
};

// Makes a scan by the convention found for the topic. Points beyond the end of the data are not
// there. A point whose time lies more than two seconds from the header stamp is dropped.
[[nodiscard]] ConvertedCloud convert_cloud(const PointCloud2Message& cloud,
                                           const CloudLayout& layout,
                                           const TimeConvention& convention);

}  // namespace understory
