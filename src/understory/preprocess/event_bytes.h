#pragma once

#include "understory/recording/recording.h"
#include "understory/util/binary_io.h"

namespace understory {

// An event of a recording in a checkpoint, bit for bit.
void put_event(BinaryWriter& writer, const Event& event);
// Throws InputError where the bytes end too early or are no event.
[[nodiscard]] Event get_event(BinaryReader& reader);

}  // namespace understory
