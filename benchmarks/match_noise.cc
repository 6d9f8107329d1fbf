// The matches of a simulated recording and their fitness, for benchmarks/match_noise.py.
//   match_noise sim:SITE?key=value&... METHOD FOLDER
// Writes FOLDER/matches.txt, a line for each scan: stamp in seconds, pose of the match, fitness.
// The pose is world from body, x y z qx qy qz qw, before it is smoothed. The fitness is over all
// points, m^2 (P4 (36)). FOLDER/truth is the truth. The local map is made as by `understory map`,
// without loops.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "understory/map/keyframes/keyframe_map.h"
#include "understory/odometry/dense/dense_odometry.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/sensor_traits.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/registration/matchers.h"
#include "understory/simulation/simulator.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

void print_match(std::FILE* file, TimeNs stamp, const RegistrationResult& match, double reach_m) {
  const Eigen::Vector3d place = match.target_from_source.translation();
  const Eigen::Quaterniond turn = match.target_from_source.rotation();
  std::fprintf(file, "%.9f %.9f %.9f %.9f %.9f %.9f %.9f %.9f %.6f\n", to_seconds(stamp), place.x(),
               place.y(), place.z(), turn.x(), turn.y(), turn.z(), turn.w(),
               overall_fitness_m2(match, reach_m));
}

// One scan after another, each matched to the keyframes before it.
class Matching {
 public:
  Matching(const DenseMappingConfig& config, const Rig& rig, const fs::path& folder)
      : config_(config),
        file_(std::fopen((folder / "matches.txt").c_str(), "w")),
        map_(config.keyframe_map, folder, times_, log_),
        odometry_(config.odometry, rig,
                  make_matcher(config.keyframe_map.local_map.matcher)->feature_finder(), times_,
                  log_) {
    map_.start();
  }
  Matching(const Matching&) = delete;
  Matching& operator=(const Matching&) = delete;
  ~Matching() { std::fclose(file_); }

  void take(const Event& event) {
    if (const auto* sample = std::get_if<ImuSample>(&event)) odometry_.add_imu(*sample);
    if (const auto* scan = std::get_if<ScanPtr>(&event)) take_scan(**scan);
  }

 private:
  void take_scan(const Scan& scan) {
    const MatchTargetPtr local_map = map_.local_map();
    const DenseEstimate estimate = odometry_.process(scan, local_map);
    if (estimate.matched) print_match(file_, scan.stamp, estimate.match, local_map->reach_m());
    if (const auto& levelled = estimate.update.new_world_from_old_world)
      static_cast<void>(map_.level(*levelled, estimate.state.world_from_body));  // one piece
    const KeyframeOffer offer = {estimate.state.world_from_body, estimate.state.pose_covariance,
                                 estimate.found_share, estimate.match.fitness_m2};
    if ((local_map != nullptr && !estimate.matched) || !map_.wants(offer)) return;
    if (map_.add(scan.stamp, offer, map_points(estimate.cloud)))
      std::fprintf(stderr, "the map has moved\n");  // without loops it does not
  }

  // Of a keyframe: thinned less than what is matched.
  FeaturePoints map_points(const BodyCloud& cloud) {
    VoxelFilterConfig voxel = config_.odometry.voxel;
    voxel.voxel_size_m = std::min(voxel.voxel_size_m, config_.keyframe_map.keyframe.voxel_size_m);
    const BodyCloud thinned = cloud.feature.empty() ? filter_.filter(cloud, voxel, true)
                                                    : filter_.filter_features(cloud, voxel, true);
    return {thinned.points, thinned.feature, {}};
  }

  DenseMappingConfig config_;
  VoxelFilter filter_;
  std::FILE* file_;
  StageTimes times_;
  Log log_;
  KeyframeMap map_;
  DenseOdometry odometry_;
};

void run(const std::string& uri, const std::string& method, const fs::path& folder) {
  fs::create_directories(folder);
  Log log;
  std::unique_ptr<Simulator> simulator = open_simulation(uri, log);
  const Simulator& site = *simulator;
  const auto asked = read_dense_mapping_config(
      "", "", {"registration.method=" + method, "loop_closure.enabled=false"});
  SensorTraits traits;
  const std::unique_ptr<Recording> recording = learn_traits(std::move(simulator), traits);
  const DenseMappingConfig config = adapt(asked.config, asked.origins, traits, {}).config;
  Matching matching(config, recording->rig(), folder);
  while (const std::optional<Event> event = recording->next())
    matching.take(*event);
  site.write_truth((folder / "truth").string());
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: match_noise sim:SITE?key=value METHOD FOLDER\n");
    return 2;
  }
  try {
    understory::run(argv[1], argv[2], argv[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
  return 0;
}
