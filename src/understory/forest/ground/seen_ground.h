#pragma once

#include "understory/geometry/raster.h"

namespace understory {

// Drops heights that are no ground at the borders of what a scanner saw of it. Behind a ridge or
// bushes only stems and crowns are seen. Their lowest points carry the cloth there, so that the
// terrain would rise to them. `ground` has the cells that the cloth touched, metres; NaN elsewhere.
// The mended heights hold:
// - Cells with many such cells around are ground (surely so inside of what was seen).
// - Others are ground if they lie on or below the plane through the ground around them, or little
//   above it. They then count for the next ones, so ground grows outwards from what is sure.
// - The rest becomes NaN, also what no ground is near to.
// After the idea of robust interpolation with weights for one side (K. Kraus and N. Pfeifer, ISPRS
// J. Photogramm. Remote Sens. 53:193, 1998), with a decision instead of weights. The result is the
// same for any number of threads.
void drop_unseen_ground(Raster& ground);

}  // namespace understory
