#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "understory/georeference/systems/default_system.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/run_summary.h"
#include "understory/util/config/config.h"
#include "understory/util/log.h"

namespace understory {

// How the layers of a run lie on the globe.
struct GeoreferenceConfig {
  bool enabled = true;            // `map`: place the layers by the recording's own fixes
  bool online = true;             // `map`: global coordinates at every scan while it runs
  std::string coordinate_system;  // "EPSG:3067", WKT; empty: chosen by the place
  HeightWish heights = HeightWish::kEllipsoid;
};
void describe(ConfigTable& table, GeoreferenceConfig& config);
// Throws ConfigError where the coordinate system is none.
void check(const GeoreferenceConfig& config);

// The frames that a result is written and drawn in.
struct ResultFrames {
  LayerFrame layers;
  // Of the report's map: that of the layers, or metres to the east and north where these are in
  // degrees.
  std::unique_ptr<LayerFrame> local;
  [[nodiscard]] const LayerFrame& drawing() const { return local ? *local : layers; }
};

// The frames of a run whose world frame lies at a place, in the coordinate system that the user
// wants or that is usual there. Fills in what `place` says of it. Where `place.heights` says
// already what heights are above, they stay so, and no geoid is asked for. Warns where the system
// is not made for the place, and where PROJ lacks the geoid that was asked for. Throws ConfigError
// where the system does not reach the place.
[[nodiscard]] ResultFrames frames_at(RunPlace& place, const GeoreferenceConfig& config, Log& log);

// What run.json of a folder says of its place: nothing where it says that it has none, or nothing.
[[nodiscard]] std::optional<RunPlace> read_run_place(const std::filesystem::path& run);
// Where run.json of a folder says that the antenna is in the body frame, metres.
[[nodiscard]] std::optional<Eigen::Vector3d> read_antenna(const std::filesystem::path& run);
// The same of the second antenna.
[[nodiscard]] std::optional<Eigen::Vector3d> read_second_antenna(const std::filesystem::path& run);
// The frame that the layers of a run folder are in.
[[nodiscard]] LayerFrame read_layer_frame(const std::filesystem::path& run);

}  // namespace understory
