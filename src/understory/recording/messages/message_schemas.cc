#include "understory/recording/messages/message_schemas.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>
#include <vector>

namespace understory {
namespace {

struct Definition {
  std::string_view name;  // "sensor_msgs/Imu"
  std::string_view text;
  std::array<std::string_view, 3> uses;  // direct dependencies
};

constexpr Definition kDefinitions[] = {
    {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n", {}},
    {"std_msgs/Header",
     "builtin_interfaces/Time stamp\nstring frame_id\n",
     {"builtin_interfaces/Time"}},
    {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n", {}},
    {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", {}},
    {"geometry_msgs/Transform",
     "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
     {"geometry_msgs/Vector3", "geometry_msgs/Quaternion"}},
    {"geometry_msgs/TransformStamped",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
     {"std_msgs/Header", "geometry_msgs/Transform"}},
    {"tf2_msgs/TFMessage",
     "geometry_msgs/TransformStamped[] transforms\n",
     {"geometry_msgs/TransformStamped"}},
    {"sensor_msgs/PointField",
     "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n"
     "uint8 FLOAT32=7\nuint8 FLOAT64=8\n"
     "string name\nuint32 offset\nuint8 datatype\nuint32 count\n",
     {}},
    {"sensor_msgs/PointCloud2",
     "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
     "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
     {"std_msgs/Header", "sensor_msgs/PointField"}},
    {"livox_ros_driver2/CustomPoint",
     "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\n"
     "uint8 line\n",
     {}},
    {"livox_ros_driver2/CustomMsg",
     "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
     "livox_ros_driver2/CustomPoint[] points\n",
     {"std_msgs/Header", "livox_ros_driver2/CustomPoint"}},
    {"sensor_msgs/Imu",
     "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
     "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
     "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
     "float64[9] linear_acceleration_covariance\n",
     {"std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"}},
    {"sensor_msgs/MagneticField",
     "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\n"
     "float64[9] magnetic_field_covariance\n",
     {"std_msgs/Header", "geometry_msgs/Vector3"}},
    {"sensor_msgs/NavSatStatus",
     "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\nint8 STATUS_GBAS_FIX=2\n"
     "int8 status\n"
     "uint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\n"
     "uint16 SERVICE_GALILEO=8\nuint16 service\n",
     {}},
    {"sensor_msgs/NavSatFix",
     "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\n"
     "float64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\n"
     "uint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
     "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\n"
     "uint8 position_covariance_type\n",
     {"std_msgs/Header", "sensor_msgs/NavSatStatus"}},
    {"nmea_msgs/Sentence", "std_msgs/Header header\nstring sentence\n", {"std_msgs/Header"}},
    {"gps_msgs/GPSStatus",
     "std_msgs/Header header\nuint16 satellites_used\nint32[] satellite_used_prn\n"
     "uint16 satellites_visible\nint32[] satellite_visible_prn\nint32[] satellite_visible_z\n"
     "int32[] satellite_visible_azimuth\nint32[] satellite_visible_snr\n"
     "int16 STATUS_NO_FIX=-1\nint16 STATUS_FIX=0\nint16 STATUS_SBAS_FIX=1\n"
     "int16 STATUS_GBAS_FIX=2\nint16 STATUS_DGPS_FIX=18\nint16 STATUS_RTK_FIX=19\n"
     "int16 STATUS_RTK_FLOAT=20\nint16 STATUS_WAAS_FIX=33\nint16 status\n"
     "uint16 motion_source\nuint16 orientation_source\nuint16 position_source\n",
     {"std_msgs/Header"}},
    {"gps_msgs/GPSFix",
     "std_msgs/Header header\ngps_msgs/GPSStatus status\nfloat64 latitude\nfloat64 longitude\n"
     "float64 altitude\nfloat64 track\nfloat64 speed\nfloat64 climb\nfloat64 pitch\n"
     "float64 roll\nfloat64 dip\nfloat64 time\nfloat64 gdop\nfloat64 pdop\nfloat64 hdop\n"
     "float64 vdop\nfloat64 tdop\nfloat64 err\nfloat64 err_horz\nfloat64 err_vert\n"
     "float64 err_track\nfloat64 err_speed\nfloat64 err_climb\nfloat64 err_time\n"
     "float64 err_pitch\nfloat64 err_roll\nfloat64 err_dip\nfloat64[9] position_covariance\n"
     "uint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
     "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\n"
     "uint8 position_covariance_type\n",
     {"std_msgs/Header", "gps_msgs/GPSStatus"}},
};

const Definition* find(std::string_view name) {
  for (const Definition& definition : kDefinitions) {
    if (definition.name == name) return &definition;
  }
  return nullptr;
}

// Depth first, each type once, the type itself at the front.
void collect(const Definition& definition, std::vector<const Definition*>& found) {
  if (std::find(found.begin(), found.end(), &definition) != found.end()) return;
  found.push_back(&definition);
  for (const std::string_view name : definition.uses) {
    if (const Definition* used = find(name)) collect(*used, found);
  }
}

}  // namespace

std::string ros2_schema(const std::string& type) {
  std::string name = type;
  const std::size_t middle = name.find("/msg/");
  if (middle != std::string::npos) name.erase(middle, 4);
  const Definition* definition = find(name);
  if (definition == nullptr) return "";
  std::vector<const Definition*> all;
  collect(*definition, all);
  std::ostringstream text;
  text << all.front()->text;
  for (std::size_t i = 1; i < all.size(); ++i)
    text << std::string(80, '=') << "\nMSG: " << all[i]->name << "\n" << all[i]->text;
  return text.str();
}

}  // namespace understory
