#include "understory/recording/clouds/las_vlrs.h"

namespace understory {
namespace {

using namespace las_bytes;

// The EPSG number of a GeoTIFF key directory: projected, else geographic; 0 if it has neither.
int epsg_of_keys(const std::vector<std::uint8_t>& keys) {
  constexpr std::uint16_t kProjected = 3072;
  constexpr std::uint16_t kGeographic = 2048;
  constexpr std::uint16_t kUserDefined = 32767;
  int projected = 0;
  int geographic = 0;
  for (std::size_t at = 8; at + 8 <= keys.size(); at += 8) {
    const auto key = get<std::uint16_t>(keys, at);
    const auto location = get<std::uint16_t>(keys, at + 2);
    const auto value = get<std::uint16_t>(keys, at + 6);
    if (location != 0 || value == 0 || value >= kUserDefined) continue;
    if (key == kProjected) projected = value;
    if (key == kGeographic) geographic = value;
  }
  return projected != 0 ? projected : geographic;
}

// Whether the extra bytes of a point (LAS 1.4, record 4 of LASF_Spec) begin with our columns.
bool are_of_trees(const std::vector<std::uint8_t>& extra_bytes) {
  constexpr std::size_t kColumn = 192;
  constexpr std::uint8_t kUnsigned32 = 5;
  constexpr std::uint8_t kFloat32 = 9;
  const auto is = [&](std::size_t column, const char* name, std::uint8_t type) {
    return get<std::uint8_t>(extra_bytes, kColumn * column + 2) == type &&
           text_of(extra_bytes, kColumn * column + 4, 32) == name;
  };
  return is(0, "tree_id", kUnsigned32) && is(1, "HeightAboveGround", kFloat32);
}

}  // namespace

LasVlrs read_las_vlrs(ByteSource& file, std::uint64_t at, std::uint32_t count) {
  constexpr std::size_t kLongestWkt = 65'535;
  std::string wkt;
  int epsg = 0;
  LasVlrs vlrs;
  std::vector<std::uint8_t> vlr;
  for (std::uint32_t i = 0; i < std::min(count, kMostVlrs); ++i) {
    file.read(at, kVlrHeader, vlr);
    if (vlr.size() < kVlrHeader) break;
    const std::string user = text_of(vlr, 2, 16);
    const auto id = get<std::uint16_t>(vlr, 18);
    const auto size = get<std::uint16_t>(vlr, 20);
    const bool projection = user == "LASF_Projection" && (id == 2112 || id == 34735);
    const bool extra_bytes = user == "LASF_Spec" && id == 4;
    if (projection || extra_bytes) file.read(at + kVlrHeader, size, vlr);
    if (projection && id == 2112) wkt = text_of(vlr, 0, kLongestWkt);
    if (projection && id == 34735) epsg = epsg_of_keys(vlr);
    if (extra_bytes) vlrs.trees = are_of_trees(vlr);
    at += kVlrHeader + size;
  }
  if (!wkt.empty()) {
    vlrs.coordinate_system = wkt;
  } else if (epsg != 0) {
    vlrs.coordinate_system = "EPSG:" + std::to_string(epsg);
  }
  return vlrs;
}

}  // namespace understory
