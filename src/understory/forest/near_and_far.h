#pragma once

#include <vector>

#include "understory/forest/ground/ground.h"
#include "understory/forest/measured_cloud.h"
#include "understory/forest/stems/bark_brightness.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/util/progress.h"

namespace understory {

// The stems of a stand as they look from afar, beside the same stems as all points show them.
// Stems are searched again among those points alone that were measured from one class of range.
// Only points count that were measured before any nearer one of the same stem. The map holds the
// first point of each small cube: later ones are missing where a stem was already seen, and remain
// beside it. A pair is told where the far range is 1.3 times that of all points, and 15 m at least.
//
// `stems`: as detected, relative to `origin` (world frame), not corrected. Two runs through the
// points; 200 stems at most, evenly chosen. The same whatever the order of points. Polls
// `progress`.
[[nodiscard]] std::vector<StemSeenTwice> look_from_afar(const MeasuredCloud& measured,
                                                        const GroundModel& ground,
                                                        const Eigen::Vector3d& origin,
                                                        const std::vector<StemFit>& stems,
                                                        const StemDetectorConfig& config,
                                                        const ProgressSink& progress);

}  // namespace understory
