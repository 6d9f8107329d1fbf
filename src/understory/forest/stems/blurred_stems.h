#pragma once

#include <functional>
#include <string>
#include <vector>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// In a blurred cloud points scatter by centimetres about the stems: the scanner is noisy, or its
// path drifted. Thin slices then miss thick stems, or show a thin one in the edge of a thick one.

// Standard deviation of the points about the surfaces of the stems, in metres: the median over
// stems in whole centimetres, 6 cm at most. 0 below 3 cm, and of fewer than three stems.
[[nodiscard]] double blur_of(const std::vector<StemFit>& stems);

// Whether stems that overlap no known one are taken.
enum class BlurredRole { kCovers, kCoversOrIsNew };

// Takes stems that were searched again into those known before. One that covers a single stem much
// thinner than itself takes its place. What overlaps a stem otherwise is left out. All centres are
// relative to one origin. The order of both lists does not matter; `stems` come back by place.
void take_blurred(std::vector<StemFit> blurred, BlurredRole role, std::vector<StemFit>& stems);

// Finds the stems of one cut among all points, also of those that known stems explain.
using CutSearch =
    std::function<std::vector<StemFit>(StemCut cut, const StemDetectorConfig& config)>;

// If the cloud is blurred, searches it again, with fits that know of the blur, and takes what that
// finds. `stems` are those of the thin and of the thick slices. Gives the blur in metres; 0 where
// the cloud is sharp.
double add_blurred_stems(const StemDetectorConfig& config, const CutSearch& search,
                         std::vector<StemFit>& stems);

// What a user has to know of a blurred cloud, in a few sentences. `blur_m`: as of blur_of;
// `range_noise_m`: as of range_noise_of.
[[nodiscard]] std::string blur_note(double blur_m, double range_noise_m);

}  // namespace understory
