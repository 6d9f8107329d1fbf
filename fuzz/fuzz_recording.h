#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "fuzz_place.h"
#include "understory/recording/messages/message_recording.h"
#include "understory/recording/recording_info.h"
#include "understory/util/error.h"

namespace understory {

// Reads a whole recording as `info` does: any bytes may come; what is damaged has to end in
// warnings or an InputError.
template <typename OpenBytes>
void read_as_recording(const std::uint8_t* data, std::size_t size, const OpenBytes& open) {
  const std::vector<std::uint8_t> bytes(data, data + size);
  Log log;
  try {
    const auto recording = open_messages(
        "fuzz", [&](Log& sink) { return open(bytes, sink); }, {}, log);
    RecordingSurvey survey;
    while (const auto event = recording->next())
      survey.add(*event);
    (void)survey.finish("fuzz", *recording, log);
    expect_to_go_on([&] {
      return open_messages(
          "fuzz", [&](Log& sink) { return open(bytes, sink); }, {}, log);
    });
  } catch (const InputError&) {
  }
}

}  // namespace understory
