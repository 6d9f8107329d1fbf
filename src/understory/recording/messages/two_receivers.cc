#include "understory/recording/messages/two_receivers.h"

#include <fmt/format.h>

#include "understory/recording/recording_constants.h"

namespace understory {
namespace {

std::string text_of(const BaselineHeadings& pairs) {
  if (pairs.pairs() == 0) return "no positions of one time: the second antenna tells no heading";
  return fmt::format(
      "{} of {} pairs of positions are not as far apart as the antennas, {:.2f} m (the last ones "
      "{:.2f} m, median): they tell no heading",
      pairs.contradicting(), pairs.pairs(), pairs.length_m(), pairs.median_distance_m());
}

}  // namespace

void TwoReceivers::judge(const TopicChoice& choice, const SensorPlaces& places) const {
  const bool apart =
      distance_m(places).value_or(0.0) >= recording_constants::baseline_headings::kShortestM;
  if (choice.second_gnss.empty() || apart) return;
  log_.warn("recording.second_antenna",
            fmt::format("{}: positions come on {}, which are used, and on {}, which are not taken "
                        "for those of a second antenna: {}. If they are, /tf_static must have a "
                        "frame for each, or give body_from_gnss, body_from_second_gnss "
                        "(--extrinsics) and --gnss-topic",
                        file_, choice.gnss, choice.second_gnss,
                        places.why_no_second_antenna(first_is_named_)));
}

void TwoReceivers::judge(const TopicChoice& choice, const BaselineHeadings& pairs, bool at_end) {
  const bool enough = at_end || pairs.pairs() >= recording_constants::kEnoughPairs;
  if (distances_told_ || !pairs.known() || !enough) return;
  if (pairs.pairs() > 0 && !pairs.most_contradict()) return;
  distances_told_ = true;
  log_.warn("recording.antenna_distance", fmt::format("{}: {} and {}: {}", file_, choice.gnss,
                                                      choice.second_gnss, text_of(pairs)));
}

}  // namespace understory
