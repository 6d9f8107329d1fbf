#pragma once

#include <string>

#include "understory/util/error.h"

namespace understory {

// The system could not read a place of the input: a failing disk, a network that went away. Unlike
// damage it is not passed over, because what follows may be intact; what was read before is good.
class ReadError : public InputError {
 public:
  // `code` is the system's errno.
  ReadError(const std::string& file, const std::string& position, int code);
};

}  // namespace understory
