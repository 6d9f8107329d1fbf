#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>

#include "understory/recording/recording.h"

namespace understory {

inline std::size_t read_to_end(Recording& recording) {
  std::size_t count = 0;
  while (recording.next())
    ++count;
  return count;
}

// Breaks a reading off in the middle and goes on in another one. There must be as many events as
// without the break, whatever is damaged. `open` opens the same recording each time.
template <typename Open>
void expect_to_go_on(const Open& open) {
  const std::size_t count = read_to_end(*open());
  const auto first = open();
  for (std::size_t i = 0; i < count / 2; ++i)
    (void)first->next();
  BinaryWriter writer;
  if (!first->save(writer)) return;
  const auto second = open();
  BinaryReader reader(writer.bytes(), "fuzz");
  second->load(reader);
  if (!reader.at_end() || read_to_end(*second) != count - count / 2) std::abort();
}

}  // namespace understory
