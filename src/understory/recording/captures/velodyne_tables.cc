#include "understory/recording/captures/velodyne_tables.h"

#include <algorithm>
#include <cmath>

#include "understory/util/angles.h"

namespace understory {
namespace {

struct Beams {
  std::vector<double> elevation_deg;
  std::vector<double> height_mm;           // empty: the manual gives none
  std::vector<double> azimuth_offset_deg;  // empty: none
};

// VLP-16 user manual, table "Laser ID, vertical angle, vertical correction".
Beams vlp16_beams() {
  return {
      {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15},
      {11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2},
      {}};
}

Beams puck_hi_res_beams() {
  return {{-10.0, 0.667, -8.667, 2.0, -7.333, 3.333, -6.0, 4.667, -4.667, 6.0, -3.333, 7.333, -2.0,
           8.667, -0.667, 10.0},
          {7.4, -0.9, 6.5, -1.8, 5.5, -2.7, 4.6, -3.7, 3.7, -4.6, 2.7, -5.5, 1.8, -6.5, 0.9, -7.4},
          {}};
}

// HDL-32E: upper and lower half of the fan take turns, 4/3 degrees apart.
Beams hdl32e_beams() {
  Beams beams;
  for (int i = 0; i < 16; ++i) {
    beams.elevation_deg.push_back(-92.0 / 3.0 + i * 4.0 / 3.0);
    beams.elevation_deg.push_back(-28.0 / 3.0 + i * 4.0 / 3.0);
  }
  return beams;
}

Beams vlp32c_beams() {
  return {{-25.0,  -1.0,   -1.667, -15.639, -11.31, 0.0,    -0.667, -8.843, -7.254, 0.333,  -0.333,
           -6.148, -5.333, 1.333,  0.667,   -4.0,   -4.667, 1.667,  1.0,    -3.667, -3.333, 3.333,
           2.333,  -2.667, -3.0,   7.0,     4.667,  -2.333, -2.0,   15.0,   10.333, -1.333},
          {},
          {1.4, -4.2, 1.4, -1.4, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 4.2, -1.4,
           1.4, -4.2, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4, 1.4, -1.4, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4}};
}

std::vector<VelodyneTable::Laser> make_lasers(const Beams& beams, double laser_us,
                                              std::size_t fired_at_once) {
  std::vector<double> sorted = beams.elevation_deg;
  std::sort(sorted.begin(), sorted.end());
  std::vector<VelodyneTable::Laser> lasers(beams.elevation_deg.size());
  for (std::size_t i = 0; i < lasers.size(); ++i) {
    const double elevation = beams.elevation_deg[i];
    VelodyneTable::Laser& laser = lasers[i];
    laser.cos_elevation = std::cos(elevation * kDegree);
    laser.sin_elevation = std::sin(elevation * kDegree);
    if (!beams.height_mm.empty()) laser.height_m = beams.height_mm[i] * 1e-3;
    if (!beams.azimuth_offset_deg.empty())
      laser.azimuth_offset_cdeg = beams.azimuth_offset_deg[i] * 100.0;
    laser.firing_us = laser_us * static_cast<double>(i / fired_at_once);
    const auto rank = std::lower_bound(sorted.begin(), sorted.end(), elevation) - sorted.begin();
    laser.ring = static_cast<std::uint16_t>(rank);
  }
  return lasers;
}

}  // namespace

VelodyneModel velodyne_model(std::uint8_t product_byte) {
  switch (product_byte) {
    case 0x21:
      return VelodyneModel::kHdl32e;
    case 0x22:
      return VelodyneModel::kVlp16;
    case 0x24:
      return VelodyneModel::kPuckHiRes;
    case 0x28:
      return VelodyneModel::kVlp32c;
    default:
      return VelodyneModel::kUnknown;
  }
}

VelodyneTable velodyne_table(VelodyneModel model) {
  switch (model) {
    case VelodyneModel::kVlp16:
      return {"VLP-16", make_lasers(vlp16_beams(), 2.304, 1), 2, 55.296, 0.002};
    case VelodyneModel::kPuckHiRes:
      return {"Puck Hi-Res", make_lasers(puck_hi_res_beams(), 2.304, 1), 2, 55.296, 0.002};
    case VelodyneModel::kHdl32e:
      return {"HDL-32E", make_lasers(hdl32e_beams(), 1.152, 1), 1, 46.08, 0.002};
    case VelodyneModel::kVlp32c:
      return {"VLP-32C", make_lasers(vlp32c_beams(), 2.304, 2), 1, 55.296, 0.004};
    case VelodyneModel::kUnknown:
      break;
  }
  return {};
}

}  // namespace understory
