#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/map/keyframes/keyframe.h"
#include "understory/map/local_map.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Which keyframes come back into an accumulated local map where the carrier comes back to them. In
// P3 the map is one for the whole way. Only those come back whose place is held by more than the
// odometry, while that of the newest is, too. Else the map would show things twice. The way
// to the first one held is held with it, as far back as the radius. Deterministic; not thread-safe.
class ReturningKeyframes {
 public:
  // Of the newest keyframe: whether satellites, or the like, hold its place.
  void add(bool held);
  // Keyframes to insert beside the newest one, nearest first. From then on they are in the map, and
  // so is the newest.
  //   first     that may come: those before are of other pieces
  //   radius_m  of the local map
  [[nodiscard]] std::vector<std::size_t> take(const std::vector<Keyframe>& keyframes,
                                              std::size_t first, double radius_m);
  // The local map was made anew of these. The newest keyframe goes in by `take`, where it is not
  // among them.
  void note_made_anew(const std::vector<LocalMapInsertion>& in_map);

  void save(BinaryWriter& writer) const;
  // Throws InputError where it is not of that many keyframes.
  void load(BinaryReader& reader, std::size_t keyframes);

 private:
  std::vector<std::uint8_t> held_;
  std::vector<std::uint8_t> gone_;  // it was farther than the radius since it went in
};

}  // namespace understory
