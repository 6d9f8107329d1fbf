#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/carrier/machine.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/sensors/beam_directions.h"
#include "understory/simulation/sensors/beam_echo.h"
#include "understory/simulation/sensors/counter_noise.h"
#include "understory/simulation/sensors/lidar_model.h"
#include "understory/simulation/sensors/weather.h"

namespace understory {

// What one scan got of one stem.
struct StemReturns {
  int tree = 0;
  int rings = 0;         // beams with at least one return from the stem
  int rings_with_3 = 0;  // beams with at least three
  int returns = 0;
};

// What gave an echo. Nothing: a ghost.
struct EchoSource {
  std::int32_t tree = 0;  // id of the tree, by its stem or its crown; 0 for anything else
  Surface surface = Surface::kNone;
};

// A point of a scan where it really lies, but for the errors of the lidar itself.
struct TruePoint {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // world frame
  TimeNs stamp = 0;                                 // as recorded
  float intensity = 0.0F;
  EchoSource source;
};

// What the beams of one scan measured, firing by firing and beam by beam in the order of the model.
struct ScanReadings {
  std::vector<BeamReading> beams;
  std::vector<BeamReading>
      seconds;                     // the weaker of two echoes, beam by beam; empty if not asked for
  std::vector<StemReturns> stems;  // by increasing id
  // Of the beams and of the weaker echoes; empty if not asked for (keep_sources).
  std::vector<EchoSource> sources;
  std::vector<EchoSource> second_sources;
};

// A scan and which stems its returns came from.
struct SimulatedScan {
  ScanPtr scan;
  std::vector<StemReturns> stems;  // by increasing id
};

// A spinning lidar carried through the forest. Every firing is cast from the true pose at its own
// time. A scan is a function of its number alone: any order, any number of threads, same bytes. One
// scan after another, as wind and harvest move the scene. The stand changes between groups
// of 16 firings only.
class Scanner {
 public:
  // All references must outlive the scanner. `start` is the time of the path's zero.
  Scanner(const SiteConfig& config, ForestScene& scene, const CarrierPath& path,
          const Machine& machine, TimeNs start);

  // Nominal times of a scan: its first firing and its last beam in the field of view.
  [[nodiscard]] TimeNs stamp(std::int64_t scan) const;
  [[nodiscard]] TimeNs end(std::int64_t scan) const;

  [[nodiscard]] SimulatedScan cast(std::int64_t scan);
  // The two halves of `cast`: what the beams measure, and the points that follow from it.
  [[nodiscard]] ScanReadings measure(std::int64_t scan);
  // From now on `measure` tells what gave each echo.
  void keep_sources() { keeps_sources_ = true; }
  // The points of a scan, in its order, by the true pose of each. `readings` must have their
  // sources.
  [[nodiscard]] std::vector<TruePoint> true_points(const Scan& scan,
                                                   const ScanReadings& readings) const;
  [[nodiscard]] ScanPtr assemble(std::int64_t scan, const ScanReadings& readings) const;

  [[nodiscard]] const Pose& body_from_lidar() const { return body_from_lidar_; }
  [[nodiscard]] const LidarModel& model() const { return model_; }

 private:
  struct Block;
  struct Look;
  void cast_block(double moment_s, Block& block) const;
  void make_rays(double moment_s, Block& block) const;
  void look_out(const Look& look, std::int64_t firing, std::pair<std::size_t, std::size_t> range,
                const std::uint32_t* slots, std::vector<Ray>& rays) const;
  [[nodiscard]] const BeamDirections& directions(std::int64_t firing, BeamDirections& swung) const;
  [[nodiscard]] const BeamDirections& reported_directions(std::int64_t firing,
                                                          BeamDirections& swung) const;
  [[nodiscard]] std::vector<std::uint32_t> trace_order() const;
  void find_slots(std::size_t firings, Block& block) const;
  void hit_machine(Block& block) const;
  void add_ghosts(Block& block) const;
  void add_spurious(Block& block) const;

  const LidarConfig config_;
  const BlindnessConfig blindness_;
  ForestScene& scene_;
  const CarrierPath& path_;
  const Machine& machine_;
  TimeNs start_;
  bool keeps_sources_ = false;
  std::uint64_t seed_;
  LidarModel model_;
  LidarWeather weather_;
  Pose body_from_lidar_;
  double bias_rad_;       // elevation_bias_deg
  BeamDirections beams_;  // of a lidar whose beams keep their elevations
  BeamDirections told_;   // as it says that they look
  // The beams of a full block (firing by firing, beam by beam), those together that look in nearly
  // the same direction.
  std::vector<std::uint32_t> order_;
};

// The pose of a sensor from its place and its roll, pitch, yaw in degrees.
[[nodiscard]] Pose mount_pose(const std::vector<double>& place_m,
                              const std::vector<double>& rpy_deg);

}  // namespace understory
