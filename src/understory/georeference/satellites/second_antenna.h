#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How the headings of a second antenna err.
struct SecondAntennaConfig {
  // s: errors of headings stay alike that long [chosen: reflections while a carrier walks]
  double correlation_s = 30.0;
  // degrees: the line between the antennas may be off what the rig says, one standard deviation
  // [chosen: half a centimetre on a metre]
  double baseline_sd_deg = 0.3;
  // Standard deviations between headings and positions beyond which headings do not count [chosen]
  double most_sigmas = 4.0;
};

// The turn about up from the world to east, north, up, by the headings of all pairs, rad. It is a
// median, with the standard deviation of it.
struct TurnByHeadings {
  double turn_rad = 0.0;
  double sd_rad = 0.0;
  std::size_t pairs = 0;  // with a heading
};

// Nothing where fewer than three pairs have a heading. The scatter of the headings or what the
// receiver states of them counts, whichever is larger. Pure function.
[[nodiscard]] std::optional<TurnByHeadings> turn_by_headings(
    const std::vector<SatellitePair>& pairs, const SecondAntennaConfig& config);

// Whether a turn by headings contradicts one by positions. Angles in rad.
[[nodiscard]] bool contradicts(double off_rad, double heading_sd_rad, double position_sd_rad,
                               const SecondAntennaConfig& config);

// The same turn while a run goes on: a filter of one state. A heading far off those before it is
// left out; many in a row begin anew. Deterministic; not thread-safe.
class TurnFilter {
 public:
  explicit TurnFilter(const SecondAntennaConfig& config) : config_(config) {}

  // The turn of a pair. `drift_sd_rad`: how far the world may have turned since the last one.
  void add(const SatellitePair& pair, double drift_sd_rad);
  void forget();
  [[nodiscard]] bool known() const { return known_; }
  [[nodiscard]] double turn_rad() const { return turn_rad_; }
  [[nodiscard]] double sd_rad() const;  // with that of the line between the antennas

  // The state, bit for bit.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  SecondAntennaConfig config_;
  bool known_ = false;
  double turn_rad_ = 0.0;
  double variance_ = 0.0;      // rad^2
  double time_s_ = 0.0;        // of the last pair
  std::uint64_t far_off_ = 0;  // in a row
};

}  // namespace understory
