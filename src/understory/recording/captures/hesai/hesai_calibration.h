#pragma once

#include <string>
#include <vector>

namespace understory {

// What files tell of one Hesai.
struct HesaiCalibration {
  std::string angles_file;            // empty: the angles of the design
  std::vector<double> elevation_deg;  // by channel
  std::vector<double> azimuth_deg;    // by channel, clockwise
  std::string firing_file;            // empty: the firing times of the manual
  std::vector<double> firing_us;      // by channel, since the start of a block
};

// Reads the angle correction file of a sensor (CSV: channel, elevation, azimuth in degrees; the
// channels from 1 on, each once). Adds it to `calibration`. Throws InputError with file and line.
void read_hesai_angles(const std::string& path, HesaiCalibration& calibration);

// Reads a firing time file (CSV: channel, time in microseconds). Throws InputError as above.
void read_hesai_firing_times(const std::string& path, HesaiCalibration& calibration);

// The calibration of a recording: the angle file that is named, or the .csv beside the recording.
// Its name begins like the recording's, or the other way round (walk.pcap: walk.csv,
// walk_angles.csv). A firing time file is found in the same way. Which is which their first line
// tells; others are passed over. Throws InputError if there are several of one kind.
[[nodiscard]] HesaiCalibration find_hesai_calibration(const std::string& recording,
                                                      const std::string& named);

}  // namespace understory
