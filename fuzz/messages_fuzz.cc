#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/point_cloud.h"

namespace {

void convert(const understory::PointCloud2Message& cloud) {
  using namespace understory;
  const auto layout = CloudLayout::find(cloud);
  if (!layout) return;
  const CloudTimes times = measure_times(cloud, *layout, 0);
  (void)highest_ring(cloud, *layout);
  const TimeConvention convention =
      detect_point_times(layout->time_field(), layout->time_type(), {times}, {});
  (void)convert_cloud(cloud, *layout, convention);
}

}  // namespace

// The first byte chooses the serialisation, the rest is decoded as every type of message.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  if (size == 0) return 0;
  const MessageReader reader(ByteSpan(data + 1, size - 1),
                             data[0] % 2 == 0 ? Serialization::kCdr : Serialization::kRos1);
  (void)decode_imu(reader);
  (void)decode_magnetic_field(reader);
  (void)decode_nav_sat_fix(reader);
  (void)decode_gps_fix(reader);
  (void)decode_transforms(reader);
  (void)decode_velodyne_scan(reader);
  (void)decode_nebula_packets(reader);
  const auto livox = decode_livox(reader);
  if (livox) convert(livox->cloud);
  const auto cloud = decode_point_cloud2(reader);
  if (cloud) convert(*cloud);
  return 0;
}
