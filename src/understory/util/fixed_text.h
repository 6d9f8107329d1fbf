#pragma once

#include <string>

namespace understory {

// A number with `decimals` decimals, for people and tables. One that rounds to zero has no sign:
// never "-0.000". "nan" and "inf" stay words.
[[nodiscard]] std::string fixed_text(double value, int decimals);
// The same with its sign also where it is positive: "+0.012", "0.000".
[[nodiscard]] std::string signed_text(double value, int decimals);

}  // namespace understory
