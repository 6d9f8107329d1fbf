#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "understory/forest/tiles/tiled_cloud.h"
#include "understory/map/clouds/map_tiles.h"
#include "understory/util/files/scratch_file.h"

namespace understory {

// The finished map of a run as the inventory takes it. It comes in one piece where that fits into
// the memory, else in tiles made of the map's own. World frame, metres.
class TiledMap : public TiledCloud {
 public:
  // `tiles` outlives this, and gets no more points. `most_bytes`: that the inventory may take; 0:
  // any. `folder` exists; for what does not fit. Where not even the smallest tile has room, that is
  // taken.
  TiledMap(MapTiles& tiles, double most_bytes, const std::filesystem::path& folder);

  [[nodiscard]] const std::vector<GroundArea>& tiles() const override { return areas_; }
  void all(const PointVisitor& visit) const override;
  void in(const GroundArea& area, const PointVisitor& visit) const override;
  [[nodiscard]] ScratchFile* scratch() const override { return scratch_ ? &*scratch_ : nullptr; }

 private:
  MapTiles& tiles_;
  std::vector<MapTiles::TileIndex> indices_;  // of the map's tiles, in order of y then x
  std::vector<GroundArea> areas_;
  mutable std::optional<ScratchFile> scratch_;
};

}  // namespace understory
