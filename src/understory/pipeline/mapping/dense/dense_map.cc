// What the dense front end makes of a recording that was read.
#include <fmt/format.h>

#include "understory/forest/cloud_shape.h"
#include "understory/pipeline/inventory/lidar_view.h"
#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/pipeline/mapping/dense/dense_results.h"
#include "understory/pipeline/mapping/finished_map.h"
#include "understory/pipeline/mapping/finished_trajectory.h"

namespace understory {
namespace {

// The finished cloud as the forest layer wants it.
PointBlocks blocks_of(MapTiles& tiles) {
  return [&tiles](const PointVisitor& visit) { tiles.for_each_place(visit); };
}

std::vector<Pose> poses_of(const std::vector<Keyframe>& keyframes) {
  std::vector<Pose> poses;
  for (const Keyframe& keyframe : keyframes)
    poses.push_back(keyframe.world_from_body);
  return poses;
}

class DenseMap : public MapMaker {
 public:
  DenseMap(DenseFrontEnd& front_end, const ReadRecording& recording)
      : front_end_(front_end), recording_(recording) {}

  void close_loops() override {
    front_end_.map().finish(recording_.progress);
    if (front_end_.config().gnss.use == GnssUse::kGeoreference) return;
    const ScopedTimer timer(front_end_.times(), "finish_gnss");
    const SolvedRun solved = solved_run();
    const std::vector<GnssFix> fixes = front_end_.fixes();
    RunWithPositions with_positions =
        use_positions(mapped_path(recording_, front_end_, solved.trajectory, fixes), solved,
                      front_end_.config().georeference, front_end_.config().gnss, recording_.log);
    if (!with_positions.world_from_keyframe.empty())
      front_end_.map().set_poses(with_positions.world_from_keyframe);
    made_.placement = std::move(with_positions.found);
  }
  void finish_map() override {
    made_.trajectory = write_dense_trajectory(recording_.results, front_end_);
    place_on_globe();
    if (!front_end_.config().map_enabled) return;
    find_own_points();
    const ScopedTimer timer(front_end_.times(), "finish_gather_map");
    const MapClouds map_clouds{front_end_.clouds().near(), front_end_.clouds().far(),
                               front_end_.config().far_m};
    made_.tiles =
        make_finished_map(map_clouds, front_end_.map().keyframes(), front_end_.config().map,
                          recording_.work / "tiles", made_.carrier, recording_.progress);
  }

  void list_trees() override {
    if (!made_.tiles) return;
    const ScopedTimer timer(front_end_.times(), "finish_inventory");
    const LidarView view = learn_view(front_end_.clouds().near(), front_end_.rig().body_from_lidar,
                                      made_.trajectory.trajectory);
    const std::vector<Pose> poses = poses_of(front_end_.map().keyframes());
    made_.forest = std::make_unique<TiledMap>(*made_.tiles, front_end_.config().inventory_bytes,
                                              recording_.work);
    InventoryConfig config = front_end_.config().inventory;
    config.beam = beams_in(config.beam, front_end_.rig());
    made_.inventory = take_inventory(*made_.forest, config, recording_.progress,
                                     seen_from(view, poses), places_of(poses));
    made_.lidar_view = figures_of(view);
    if (front_end_.counts().imu_samples == 0)
      made_.not_upright =
          up_complaint(shape_of(polled(blocks_of(*made_.tiles), recording_.progress)));
  }

  RunOutcome write() override { return write_dense_results(recording_, front_end_, made_); }

 private:
  // What carries the lidar, if nobody told by boxes.
  void find_own_points() {
    const DenseMappingConfig& config = front_end_.config();
    if (!config.odometry.machine_boxes_file.empty()) return;
    const ScopedTimer timer(front_end_.times(), "finish_find_carrier");
    made_.carrier.path = made_.trajectory.trajectory;
    made_.carrier.region = find_carrier(
        front_end_.clouds().near(), front_end_.map().keyframes(), made_.carrier.path,
        front_end_.rig().body_from_lidar.translation(), config.carrier, recording_.progress);
  }
  // By the run's own fixes; gnss.csv.
  void place_on_globe() {
    const ScopedTimer timer(front_end_.times(), "finish_georeference");
    const std::vector<GnssFix> fixes = front_end_.fixes();
    made_.has_fixes = !fixes.empty();
    const MappedPath path = mapped_path(recording_, front_end_, made_.trajectory.trajectory, fixes);
    const GeoreferenceConfig& config = front_end_.config().georeference;
    made_.placed = made_.placement ? place_map(path, *made_.placement, config, recording_.log)
                                   : place_map(path, config, recording_.log);
  }
  [[nodiscard]] SolvedRun solved_run() const {
    const KeyframeMap& map = front_end_.map();
    SolvedRun run{map.graph(), map.graph_loops_used(), {}, {}};
    for (const Keyframe& keyframe : map.keyframes())
      run.stamps.push_back(keyframe.stamp);
    for_each_finished_scan(front_end_.journal(), map.keyframes(), [&](const FinishedScan& scan) {
      run.trajectory.push_back({scan.record->stamp, scan.world_from_body});
    });
    return run;
  }

  DenseFrontEnd& front_end_;
  ReadRecording recording_;
  DenseProducts made_;
};

}  // namespace

std::string DenseFrontEnd::why_no_map(const Recording& source) const {
  std::string topics;
  std::uint64_t empty = 0;
  for (const TopicReport& topic : source.topics()) {
    topics += (topics.empty() ? "" : ", ") + topic.name + " (" + topic.type + ")";
    empty += topic.empty_points;
  }
  if (received_.counts.scans > 0) {
    return fmt::format(
        "none of its {} scans has points to map: {} points are not a number or at zero range. "
        "The others are too near, too far or on the machine. `understory info` tells the ranges: "
        "ranges of thousands are millimetres or centimetres, and points are expected in metres",
        received_.counts.scans, empty);
  }
  return "no lidar scan could be read from it" +
         (topics.empty() ? std::string() : "; it holds " + topics);
}

std::unique_ptr<MapMaker> DenseFrontEnd::map_maker(const ReadRecording& recording) {
  if (traits_.scan_points == 0) {
    log_.warn("lidar.unknown",
              recording.request.recording +
                  ": no scan in the first messages shows what lidar this is: no setting was "
                  "adapted to it");
  }
  if (config_.odometry.tops.points == ScanPoints::kTreeTops && received_.counts.by_tree_tops == 0) {
    log_.warn("tree_tops.none",
              fmt::format("preprocess.points=tree_tops: no scan has {} points around tree tops, so "
                          "all points were matched",
                          config_.odometry.tops.least_points));
  }
  if (!recording.facts.stopped) {
    remark_on_input({last_imu(), last_scan_end()}, recording.source, recording.facts.time_repair,
                    recording.request.recording, log_);
  }
  return std::make_unique<DenseMap>(*this, recording);
}

}  // namespace understory
