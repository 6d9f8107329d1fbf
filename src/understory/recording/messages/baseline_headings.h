#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "understory/sensor/gnss_fix.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Heading of the line from one antenna to another by their positions, degrees: clockwise from true
// north, 0 to 360, and its standard deviation.
struct HeadingByPositions {
  double heading_deg = 0.0;
  double sd_deg = 0.0;
};

// Headings by the positions of two antennas on one carrier, and whether the distance between the
// positions is that of the antennas.
//
// A pair whose distance is far off tells no heading. The standard deviation across the line comes
// from both covariances. The scatter of the distances about that of the antennas replaces it, if
// larger. Receivers under trees promise too much, and errors across the line are as large as those
// along it. Errors that both antennas share cancel, and the covariances do not tell which they are:
// then a heading is better than it says. Where the distances scatter by too much, those that are
// right are so by chance, and no pair tells a heading.
//
// Deterministic; not thread-safe.
class BaselineHeadings {
 public:
  // Distance of the antennas on the carrier, metres. Nothing: it is not known, or too short to tell
  // a heading; no pair counts then.
  void set_length_m(std::optional<double> length_m);
  [[nodiscard]] bool known() const { return length_m_ > 0.0; }
  [[nodiscard]] double length_m() const { return length_m_; }

  // Of two fixes of one moment. Nothing without a position or a height, where the distance is
  // wrong, or for a line steeper than 60 degrees. Nothing, too, while too few pairs were seen to
  // know their scatter.
  [[nodiscard]] std::optional<HeadingByPositions> add(const GnssFix& first, const GnssFix& second);

  [[nodiscard]] std::uint64_t pairs() const { return pairs_; }
  [[nodiscard]] std::uint64_t contradicting() const { return contradicting_; }
  [[nodiscard]] bool most_contradict() const { return 2 * contradicting_ > pairs_; }
  // Median of the last distances, metres; 0 where there is none.
  [[nodiscard]] double median_distance_m() const;

  // The state, bit for bit.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // Standard deviation of a distance about that of the antennas, metres, by the last ones.
  [[nodiscard]] double scatter_m() const;

  double length_m_ = 0.0;
  std::deque<double> distances_m_;  // the last ones, right or wrong
  std::uint64_t pairs_ = 0;
  std::uint64_t contradicting_ = 0;
};

// The last positions of a second antenna, to be had for the times of those of the first one. Not
// thread-safe.
class SecondPositions {
 public:
  // In the order of time; one that goes back begins anew.
  void add(const GnssFix& fix);
  // The position at a time: the one of that moment, else between two that are close. Nothing as
  // long as there is none.
  [[nodiscard]] std::optional<GnssFix> at(TimeNs stamp) const;
  // The nearest one, where it is so near that only the stamps may differ. It is less certain by the
  // way that the antenna goes in between.
  [[nodiscard]] std::optional<GnssFix> near(TimeNs stamp) const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::deque<GnssFix> last_;
};

}  // namespace understory
