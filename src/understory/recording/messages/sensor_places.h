#pragma once

#include <optional>
#include <string>

#include "understory/recording/extrinsics.h"
#include "understory/sensor/rig.h"
#include "understory/util/log.h"

namespace understory {

// Where the sensors of a recording are on its body: by the frames of their messages, the transforms
// between frames, and an extrinsics file. More of each may become known while the recording is
// read. Not thread-safe.
class SensorPlaces {
 public:
  // `transforms` may grow; both it and `log` must outlive this. No file: an empty name.
  // `lidar_entry`: of the file's list of lidars.
  SensorPlaces(const TransformTree& transforms, std::string extrinsics_file, int lidar_entry,
               Log& log)
      : transforms_(transforms),
        extrinsics_file_(std::move(extrinsics_file)),
        lidar_entry_(lidar_entry),
        log_(log) {}

  // The rig by what is known now. With `body_stays` the body is what it was, and only the places of
  // other sensors are added. True if one was added that matters to a run that goes on.
  bool place(bool body_stays);
  // Whether there is a sensor whose place is not known.
  [[nodiscard]] bool lacks_any() const;
  // Why the IMU cannot be used, for a warning: its place is not known. Empty: it is.
  [[nodiscard]] std::string why_no_imu() const;
  // From one antenna to the other, metres; nothing where the place of one is not known. The origin
  // of the body is no antenna by its frame alone: filters state their positions there. A file that
  // places the antennas means topics that are named. Without names the busier one is the first, and
  // a line the wrong way round turns the map by 180 degrees.
  [[nodiscard]] std::optional<double> antenna_distance_m(bool first_is_named) const;
  // Why there is none, for a warning.
  [[nodiscard]] std::string why_no_second_antenna(bool first_is_named) const;

  // The scans hold the points of so many lidars besides the first one, as the project writes them
  // (further_lidar_frame); before `place`.
  void set_merged_lidars(std::size_t count) { merged_lidars_ = count; }

  [[nodiscard]] SensorFrames& frames() { return frames_; }
  [[nodiscard]] const SensorFrames& frames() const { return frames_; }
  [[nodiscard]] Rig& rig() { return rig_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }

 private:
  void apply_extrinsics();
  [[nodiscard]] bool by_file() const;

  const TransformTree& transforms_;
  std::string extrinsics_file_;
  int lidar_entry_;
  std::size_t merged_lidars_ = 0;  // besides the first one, in the same scans
  Log& log_;
  SensorFrames frames_;
  Rig rig_;
  bool extrinsics_told_ = false;  // what the file leaves open has been warned of
};

}  // namespace understory
