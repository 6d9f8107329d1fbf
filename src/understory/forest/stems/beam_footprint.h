#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "understory/util/config/config.h"

namespace understory {

// Lidars whose beams are known from their data sheets. kRecording: the one that the recording
// names.
enum class LidarSensor { kRecording, kUnknown, kOs0, kOs1, kVlp16, kVlp32 };

// How wide the beams of the scanner are and how weak an echo it still tells. Numbers that are 0 are
// those of the sensor; of an unknown sensor nothing is compensated.
struct BeamConfig {
  LidarSensor sensor = LidarSensor::kRecording;
  double divergence_mrad = 0.0;  // full width, four standard deviations of a Gaussian beam
  double exit_m = 0.0;           // width at the sensor
  double reach_m = 0.0;          // from here half of the echoes of a surface of 10 % return
};
void describe(ConfigTable& table, BeamConfig& config);

// The lidar of this model, as recordings name it ("OS-0-128", "OS1-64", "VLP-16"); kUnknown for
// any other name.
[[nodiscard]] LidarSensor sensor_of_model(std::string_view lidar_model);

// The beams of that lidar. Of one that is not known they are as wide as those of most lidars. Those
// of simulated recordings with one ray a beam have no width, and their name says so.
[[nodiscard]] BeamConfig usual_beams(std::string_view lidar_model);

// The beams that met a stem.
struct BeamFootprint {
  double sd_m = 0.0;    // a quarter of their width there; 0: nothing is known of them
  double signal = 0.0;  // a whole beam square on bark over the weakest echo that is told
};
// Of beams that come from `range_m` away; nothing where the range or the beams are not known (0).
[[nodiscard]] BeamFootprint footprint_at(const BeamConfig& config, double range_m);

// Mean range from which a place was seen, over the returns, whose number falls with the square of
// the distance. `scanner`: places of the scanner, metres, in the frame of the place. What stands in
// between is not looked at. 0 without places.
[[nodiscard]] double mean_range_to(const std::vector<Eigen::Vector3d>& scanner,
                                   const Eigen::Vector3d& place);

// By how much half of the width over which a stem's returns are spread exceeds its radius, metres;
// negative where it is smaller. A beam that hits the edge with a part of its footprint still gives
// an echo. The point is put on the middle of the beam: beside the stem. A part that is too small,
// or that meets the bark too steeply, gives none.
//
// The beam is a Gaussian across, the stem a cylinder, its echo the part of the beam on it times the
// cosine of incidence. An echo is told with the chance s^3 / (1 + s^3), s its strength over the
// threshold. The same holds for the part of the beam over a least one: what lies behind the stem
// gives the stronger echo else.
[[nodiscard]] double excess_width_m(const BeamFootprint& beam, double radius_m);

// The standard deviation of a diameter, metres. `spread_m`: that of the radius, as if returns were
// independent and their places on the surface known. `range_m`: from where the stem was seen on
// average; 0 where it is not known. `beam`: those for which excess_radius_m was taken away, or
// nothing. Weak echoes come from a smaller part of the stem, so its width is less sure.
[[nodiscard]] double diameter_sd_m(double spread_m, double arc_deg, double range_m,
                                   const BeamFootprint& beam);

// By how much a fit of `arc_deg` of the circumference makes a radius too large for that, metres.
// Negative where it makes it too small, 0 where the beams are not known. The whole excess counts
// where a stem was seen from one side, and a part of the beam where it was seen all around. Of that
// the fit itself removes the more, the wider the beam is beside the stem.
[[nodiscard]] double excess_radius_m(const BeamFootprint& beam, double radius_m, double arc_deg);

}  // namespace understory
