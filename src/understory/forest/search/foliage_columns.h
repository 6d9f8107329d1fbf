#pragma once

#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Thin columns within foliage. Young trees that are green to the ground hide their stems among the
// points of their own branches. No circle shows there, and no surface stands clear. A thin column
// does: it holds many more points than the space around it, in one slice after the other.
//
// Gives starts of fits, the clearest first: centre and slope of the column, a usual radius, and the
// slices that show it. None is near another. Points that `explained` marks are left out. Columns
// beyond the area of the search by more than 3 m are not looked for; what the tiles of a cloud
// share they find alike. Polls `progress`.
[[nodiscard]] std::vector<StemFit> find_foliage_columns(const std::vector<SlicePoint>& points,
                                                        const std::vector<char>& explained,
                                                        const StemDetectorConfig& config,
                                                        const StemSearchArea& where,
                                                        const ProgressSink& progress);

// Whether foliage surrounds a column: `near` has points to nearly all sides of it. A wall, a post
// or the side of a vehicle has none behind it.
[[nodiscard]] bool stands_in_foliage(const std::vector<SlicePoint>& near, const StemFit& column);

// Whether a column within foliage ends too low for its diameter: the dense foliage of a seedling
// can look like a stem of several centimetres. `slices_end_m`: height above the ground up to which
// points were searched. A column that goes on beyond it is none.
[[nodiscard]] bool is_too_stout(const StemFit& column, double slices_end_m);

}  // namespace understory
