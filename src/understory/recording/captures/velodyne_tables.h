#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace understory {

// Models of Velodyne that packets are decoded of.
enum class VelodyneModel { kUnknown, kVlp16, kHdl32e, kPuckHiRes, kVlp32c };

// Geometry and timing of one Velodyne model, from its user manual.
struct VelodyneTable {
  struct Laser {
    double cos_elevation = 1.0;
    double sin_elevation = 0.0;
    double azimuth_offset_cdeg = 0.0;  // added to the interpolated azimuth
    double height_m = 0.0;             // where the beam leaves the optics ("vertical correction")
    double firing_us = 0.0;            // since the start of its firing sequence
    std::uint16_t ring = 0;            // from the lowest beam up
  };
  std::string name;
  std::vector<Laser> lasers;    // in the order of the packet
  int sequences_per_block = 1;  // 2 for 16 lasers, since a block holds 32 returns
  double sequence_us = 55.296;  // from one firing sequence to the next
  double distance_unit_m = 0.002;
};

// The model for a packet's product byte; kUnknown for others (HDL-64E and VLS-128 have layouts of
// their own and are not read).
[[nodiscard]] VelodyneModel velodyne_model(std::uint8_t product_byte);
[[nodiscard]] VelodyneTable velodyne_table(VelodyneModel model);

}  // namespace understory
