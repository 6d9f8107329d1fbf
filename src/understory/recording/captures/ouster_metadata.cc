#include "understory/recording/captures/ouster_metadata.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

using Json = nlohmann::json;

constexpr int kLargestFrame = 8192;
constexpr int kMostPixels = 256;
constexpr std::uintmax_t kLargestMetadata = 4'000'000;

// Looks a key up in the sections of every layout, the nested ones first.
class Lookup {
 public:
  Lookup(const Json& root, std::string file) : root_(root), file_(std::move(file)) {}

  [[nodiscard]] const Json* find(const std::string& key) const {
    static constexpr const char* kSections[] = {
        "sensor_info",       "beam_intrinsics", "lidar_intrinsics", "imu_intrinsics",
        "lidar_data_format", "config_params",   "data_format"};
    for (const char* section : kSections) {
      const auto place = root_.find(section);
      if (place != root_.end() && place->is_object() && place->contains(key)) return &(*place)[key];
    }
    const auto flat = root_.find(key);
    return flat != root_.end() ? &*flat : nullptr;
  }

  [[noreturn]] void fail(const std::string& key, const std::string& expected) const {
    throw InputError(file_, key, expected);
  }

  [[nodiscard]] std::string text(const std::string& key) const {
    const Json* value = find(key);
    return value != nullptr && value->is_string() ? value->get<std::string>() : std::string();
  }

  [[nodiscard]] std::optional<double> number(const std::string& key) const {
    const Json* value = find(key);
    if (value == nullptr || value->is_null()) return std::nullopt;
    if (!value->is_number() || !std::isfinite(value->get<double>())) fail(key, "expected a number");
    return value->get<double>();
  }

  [[nodiscard]] int integer(const std::string& key, int low, int high, int otherwise) const {
    const auto value = number(key);
    if (!value) return otherwise;
    if (*value < low || *value > high || *value != std::floor(*value)) {
      fail(key, "expected an integer from " + std::to_string(low) + " to " + std::to_string(high));
    }
    return static_cast<int>(*value);
  }

  [[nodiscard]] std::vector<double> numbers(const std::string& key) const {
    const Json* value = find(key);
    std::vector<double> result;
    if (value == nullptr) return result;
    if (!value->is_array()) fail(key, "expected a list of numbers");
    for (const Json& element : *value) {
      if (!element.is_number() || !std::isfinite(element.get<double>()))
        fail(key, "expected a list of finite numbers");
      result.push_back(element.get<double>());
    }
    return result;
  }

  // A row-major 4 x 4 matrix with its translation in millimetres.
  [[nodiscard]] std::optional<Eigen::Matrix4d> transform(const std::string& key) const {
    const std::vector<double> values = numbers(key);
    if (values.empty()) return std::nullopt;
    if (values.size() != 16) fail(key, "expected 16 numbers");
    Eigen::Matrix4d matrix =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
    matrix.topRightCorner<3, 1>() *= 1e-3;
    return matrix;
  }

  [[nodiscard]] Pose pose(const std::string& key, const Pose& otherwise) const {
    const auto matrix = transform(key);
    if (!matrix) return otherwise;
    const Eigen::Matrix3d rotation = matrix->topLeftCorner<3, 3>();
    const double defect = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
    if (!(defect < 1e-3) || rotation.determinant() < 0.0) fail(key, "expected a rigid transform");
    return Pose::from_matrix(*matrix);
  }

 private:
  const Json& root_;
  std::string file_;
};

OusterProfile profile_of(const Lookup& json) {
  const std::string name = json.text("udp_profile_lidar");
  if (name.empty() || name == "LEGACY") return OusterProfile::kLegacy;
  if (name == "RNG19_RFL8_SIG16_NIR16") return OusterProfile::kRng19;
  if (name == "RNG19_RFL8_SIG16_NIR16_DUAL") return OusterProfile::kDual;
  if (name == "RNG15_RFL8_NIR8") return OusterProfile::kRng15;
  if (name == "RNG15_RFL8_NIR8_DUAL") return OusterProfile::kRng15Dual;
  json.fail("udp_profile_lidar",
            "profile " + name +
                " is not known; expected LEGACY, RNG19_RFL8_SIG16_NIR16 (_DUAL) "
                "or RNG15_RFL8_NIR8 (_DUAL)");
}

// "1024x10"
int columns_of_mode(const std::string& mode) {
  const std::size_t cross = mode.find('x');
  if (cross == 0 || cross == std::string::npos || cross > 4) return 0;
  int columns = 0;
  for (const char c : mode.substr(0, cross)) {
    if (c < '0' || c > '9') return 0;
    columns = columns * 10 + (c - '0');
  }
  return columns;
}

void read_frame(const Lookup& json, OusterMetadata& out) {
  out.columns_per_frame =
      json.integer("columns_per_frame", 1, kLargestFrame, columns_of_mode(out.mode));
  if (out.columns_per_frame < 1)
    json.fail("columns_per_frame", "expected it, or a lidar_mode such as 1024x10");
  out.columns_per_packet = json.integer("columns_per_packet", 1, 64, 16);
  out.last_column = out.columns_per_frame - 1;
  const std::vector<double> window = json.numbers("column_window");
  if (window.empty()) return;
  if (window.size() != 2 || window[0] < 0 || window[1] < 0 || window[0] >= out.columns_per_frame ||
      window[1] >= out.columns_per_frame)
    json.fail("column_window", "expected two columns of the frame");
  out.first_column = static_cast<int>(window[0]);
  out.last_column = static_cast<int>(window[1]);
}

void read_beams(const Lookup& json, OusterMetadata& out) {
  out.beam_altitude_deg = json.numbers("beam_altitude_angles");
  out.beam_azimuth_deg = json.numbers("beam_azimuth_angles");
  const std::size_t beams = out.beam_altitude_deg.size();
  out.pixels_per_column =
      json.integer("pixels_per_column", 1, kMostPixels, static_cast<int>(beams));
  if (beams == 0 || beams != out.beam_azimuth_deg.size() ||
      beams != static_cast<std::size_t>(out.pixels_per_column)) {
    json.fail("beam_altitude_angles, beam_azimuth_angles",
              "expected one number for each of the beams");
  }
  if (const auto offset = json.number("lidar_origin_to_beam_origin_mm"))
    out.lidar_from_beam(0, 3) = *offset * 1e-3;
  if (const auto transform = json.transform("beam_to_lidar_transform"))
    out.lidar_from_beam = *transform;
}

// What firmware before 1.13 leaves out, from the sensors' drawings.
void read_placement(const Lookup& json, OusterMetadata& out) {
  Eigen::Matrix4d turned = Eigen::Matrix4d::Identity();
  turned(0, 0) = turned(1, 1) = -1.0;
  turned(2, 3) = 0.03618;
  out.sensor_from_lidar = json.pose("lidar_to_sensor_transform", Pose::from_matrix(turned));
  out.sensor_from_imu = json.pose(
      "imu_to_sensor_transform",
      Pose(Eigen::Matrix3d::Identity().eval(), Eigen::Vector3d(6.253, -11.775, 7.645) * 1e-3));
}

}  // namespace

std::size_t OusterMetadata::pixel_size() const {
  switch (profile) {
    case OusterProfile::kRng15:
      return 4;
    case OusterProfile::kRng15Dual:
      return 8;
    case OusterProfile::kDual:
      return 16;
    case OusterProfile::kLegacy:
    case OusterProfile::kRng19:
      break;
  }
  return 12;
}

std::size_t OusterMetadata::column_size() const {
  const std::size_t around = profile == OusterProfile::kLegacy ? 16 + 4 : 12;
  return around + static_cast<std::size_t>(pixels_per_column) * pixel_size();
}

std::size_t OusterMetadata::lidar_packet_size() const {
  const std::size_t around = profile == OusterProfile::kLegacy ? 0 : 32 + 32;
  return around + static_cast<std::size_t>(columns_per_packet) * column_size();
}

Rig OusterMetadata::rig() const {
  Rig rig;
  rig.body_frame = "imu";
  rig.body_from_lidar = sensor_from_imu.inverse();
  rig.body_from_imu = Pose();
  rig.lidar_model = product;
  rig.lidar_extrinsic_source = rig.imu_extrinsic_source = "sensor metadata";
  return rig;
}

OusterMetadata parse_ouster_metadata(const std::string& text, const std::string& file) {
  const Json root = Json::parse(text, nullptr, false);
  if (root.is_discarded() || !root.is_object())
    throw InputError(file, "", "expected the metadata of an Ouster sensor as JSON");
  const Lookup json(root, file);
  OusterMetadata out;
  out.product = json.text("prod_line");
  out.serial = json.text("prod_sn");
  out.firmware = json.text("build_rev");
  out.mode = json.text("lidar_mode");
  out.time_mode = json.text("timestamp_mode");
  out.profile = profile_of(json);
  read_frame(json, out);
  read_beams(json, out);
  read_placement(json, out);
  out.lidar_port = json.integer("udp_port_lidar", 0, 65'535, 0);
  out.imu_port = json.integer("udp_port_imu", 0, 65'535, 0);
  const std::string imu_profile = json.text("udp_profile_imu");
  out.legacy_imu = imu_profile.empty() || imu_profile == "LEGACY";
  return out;
}

OusterMetadata read_ouster_metadata(const std::string& path) {
  return parse_ouster_metadata(read_text_file(path, kLargestMetadata), path);
}

}  // namespace understory
