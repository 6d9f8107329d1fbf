#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/forest/ground_area.h"
#include "understory/forest/point_blocks.h"
#include "understory/util/files/scratch_file.h"
#include "understory/util/parallel_pieces.h"

namespace understory {

// A cloud whose points can be had by their places, so that an inventory holds one part of it at a
// time. World frame, metres, z up. NaN coordinates are not allowed. All calls are thread-safe where
// `side_by_side` is.
class TiledCloud {
 public:
  virtual ~TiledCloud() = default;

  // Areas side by side that hold all points between them; a single endless one where the cloud lies
  // in one piece.
  [[nodiscard]] virtual const std::vector<GroundArea>& tiles() const = 0;
  // Whether several tiles may be at work at once.
  [[nodiscard]] virtual bool side_by_side() const { return false; }
  // Each point once.
  virtual void all(const PointVisitor& visit) const = 0;
  // Each point in the area once, and some beside it.
  virtual void in(const GroundArea& area, const PointVisitor& visit) const = 0;
  // A round height near that of the cloud, the same whatever its tiles are. Heights are held in
  // single precision from there. Nothing: that of the first point.
  [[nodiscard]] virtual std::optional<double> level() const { return std::nullopt; }
  // For what does not fit into memory; null: all fits.
  [[nodiscard]] virtual ScratchFile* scratch() const { return nullptr; }
};

// Calls body(tile) for each tile: one after the other, or side by side where the cloud allows it.
template <typename Body>
void for_tiles(const TiledCloud& cloud, const Body& body) {
  const std::size_t count = cloud.tiles().size();
  if (cloud.side_by_side()) return parallel_pieces(count, body);
  for (std::size_t tile = 0; tile < count; ++tile)
    body(tile);
}

// The tiles that share a place with an area.
[[nodiscard]] inline std::vector<std::size_t> tiles_touching(const TiledCloud& cloud,
                                                             const GroundArea& area) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < cloud.tiles().size(); ++i) {
    const GroundArea& tile = cloud.tiles()[i];
    if (area.touches(tile.low, tile.high)) found.push_back(i);
  }
  return found;
}

// A cloud in one piece, which outlives this.
class WholeCloud : public TiledCloud {
 public:
  explicit WholeCloud(const PointBlocks& cloud) : cloud_(cloud), tiles_(1) {}
  [[nodiscard]] const std::vector<GroundArea>& tiles() const override { return tiles_; }
  void all(const PointVisitor& visit) const override { cloud_(visit); }
  void in(const GroundArea&, const PointVisitor& visit) const override { cloud_(visit); }

 private:
  const PointBlocks& cloud_;
  std::vector<GroundArea> tiles_;
};

}  // namespace understory
