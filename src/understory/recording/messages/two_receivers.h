#pragma once

#include <string>

#include "understory/recording/messages/baseline_headings.h"
#include "understory/recording/messages/message_survey.h"
#include "understory/recording/messages/sensor_places.h"
#include "understory/util/log.h"

namespace understory {

// What is said of a recording with two topics of positions. Not thread-safe.
class TwoReceivers {
 public:
  // `first_is_named`: the user named the topic of the first antenna. `log` must outlive this.
  TwoReceivers(std::string file, bool first_is_named, Log& log)
      : file_(std::move(file)), first_is_named_(first_is_named), log_(log) {}

  // Metres from one antenna to the other; nothing where their places are not known.
  [[nodiscard]] std::optional<double> distance_m(const SensorPlaces& places) const {
    return places.antenna_distance_m(first_is_named_);
  }
  // Warns where the second topic is not taken for a second antenna ("recording.second_antenna").
  void judge(const TopicChoice& choice, const SensorPlaces& places) const;
  // Warns once where most pairs of positions tell no heading ("recording.antenna_distance"): as
  // soon as there are enough of them, or at the end.
  void judge(const TopicChoice& choice, const BaselineHeadings& pairs, bool at_end);

  void save(BinaryWriter& writer) const { writer.put(distances_told_); }
  void load(BinaryReader& reader) { distances_told_ = reader.get<bool>(); }

 private:
  std::string file_;
  bool first_is_named_ = false;
  Log& log_;
  bool distances_told_ = false;
};

}  // namespace understory
